"""The presets and their refinement."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.preset_names import FREE_PRESET_WORDS, PRESET_NAMES
from porotwin_solver.model.presets import (
    IMPLICIT,
    MAX_REFINED_CELLS,
    PRESETS,
    free_run_preset,
    preset_named,
)
from porotwin_solver.transport.scheme import Scheme


def test_presets_are_found_by_their_names() -> None:
    assert {name: preset.scheme for name, preset in PRESETS.items()} == {
        'fast': Scheme.SUPERBEE,
        'accurate': Scheme.THIRD_ORDER,
        'sharp': Scheme.COMPRESSIVE,
        'upwind': Scheme.UPWIND,
        'implicit': Scheme.UPWIND,
    }
    assert all(preset_named(name).name == name for name in PRESETS)


def test_an_unknown_preset_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="preset 'quick': unknown; choose from fast, accurate"):
        preset_named('quick')


@pytest.mark.parametrize(
    ('cells', 'factor'), [((94, 56), 4), ((187, 112), 2), ((374, 225), 1)], ids=str
)
def test_the_accurate_preset_refines_up_to_a_number_of_cells(cells, factor) -> None:
    grid = Grid(*cells, 0.934, 0.562)
    assert PRESETS['accurate'].refinement(grid) == factor
    assert grid.nx * grid.nz * factor**2 <= MAX_REFINED_CELLS
    assert PRESETS['fast'].refinement(grid) == 1


def test_the_help_texts_name_every_preset() -> None:
    assert tuple(PRESETS) == PRESET_NAMES


def test_a_free_run_takes_no_preset_of_single_intervals() -> None:
    assert free_run_preset('upwind') is PRESETS['upwind']
    assert IMPLICIT not in FREE_PRESET_WORDS
    with pytest.raises(InputError, match='take upwind'):
        free_run_preset(IMPLICIT)
