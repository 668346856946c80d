"""The description of a rig divides sands that look alike, and joins one sand in two places."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from porotwin_core.rig import Rig, load_rig, parse_rig
from porotwin_imaging.calibrating import sands
from porotwin_imaging.calibrating.described_sands import (
    described_kinds,
    described_parts,
    sand_names,
)
from porotwin_imaging.calibrating.sands import SandLevel

RIGS = Path(__file__).resolve().parents[2] / 'rigs'

ROWS, COLUMNS = 60, 100


def halves(edge: int) -> np.ndarray:
    """Return 0 left of the column `edge` and 1 right of it."""
    return np.broadcast_to((np.arange(COLUMNS) >= edge).astype(np.uint8), (ROWS, COLUMNS)).copy()


def layers(edge: int) -> np.ndarray:
    """Return 0 below the row `edge` and 1 above it."""
    return np.broadcast_to((np.arange(ROWS) >= edge)[:, None], (ROWS, COLUMNS)).astype(np.uint8)


def test_sands_that_look_alike_are_divided_by_their_description() -> None:
    found = described_parts(np.zeros((ROWS, COLUMNS), np.uint8), halves(40))
    np.testing.assert_array_equal(found.labels, halves(40))
    assert found.same == ()


def test_one_sand_that_looks_like_two_stays_in_two_parts_of_one_kind() -> None:
    found = described_parts(layers(30), halves(50))
    assert found.labels.max() == 3
    assert found.same == ((0, 2), (1, 3))


def test_the_edge_of_the_picture_counts_where_the_description_is_a_little_off() -> None:
    found = described_parts(halves(50), halves(53))
    np.testing.assert_array_equal(found.labels, halves(50))


@pytest.mark.parametrize('kinds', [None, np.zeros((ROWS, COLUMNS), np.uint8)])
def test_without_described_sands_the_picture_alone_decides(kinds: np.ndarray | None) -> None:
    np.testing.assert_array_equal(described_parts(halves(50), kinds).labels, halves(50))


@pytest.fixture
def rig() -> Rig:
    return load_rig(RIGS / 'small')


def test_a_description_knows_sands_by_their_permeability(rig: Rig) -> None:
    grid = rig.grid(COLUMNS, ROWS)
    assert described_kinds(rig, grid) is None
    two = rig.with_maps({'permeability_m2': np.where(halves(50), 1e-9, 1e-10)})
    found = described_kinds(two, grid)
    assert found is not None
    np.testing.assert_array_equal(found, 1 - halves(50) if found[0, 0] else halves(50))


def test_a_field_of_permeabilities_is_no_sand(rig: Rig) -> None:
    field = 1e-9 * np.exp(np.random.default_rng(1).normal(size=(ROWS, COLUMNS)))
    varied = rig.with_maps({'permeability_m2': field})
    assert described_kinds(varied, rig.grid(COLUMNS, ROWS)) is None


def test_a_sand_without_a_core_takes_the_factor_of_the_same_sand() -> None:
    labels, flat = halves(50), np.ones((ROWS, COLUMNS))
    levels = {0: SandLevel(1.0, 0.007, 1000)}
    lights = np.array([0.0, 0.5])
    guessed = sands.fit_factors([flat * np.nan], labels, levels, 1.0, lights)
    known = sands.fit_factors([flat * np.nan], labels, levels, 1.0, lights, ((0, 1),))
    assert guessed.values[1] > 1.2
    assert known.values[1] == pytest.approx(1.0, abs=0.12)
    assert known.deviations[1] < 0.1 < guessed.deviations[1]


def test_labels_have_the_names_of_rig_yaml(rig: Rig) -> None:
    grid = rig.grid(COLUMNS, ROWS)
    assert sand_names(rig, grid, halves(50)) == ('', '')
    sands = {
        'coarse': {'porosity': 0.4, 'permeability_m2': 1e-9},
        'silt': {'porosity': 0.4, 'permeability_m2': 1e-11},
        'washed silt': {'porosity': 0.38, 'permeability_m2': 1e-11},
    }
    file = RIGS / 'small' / 'rig.yaml'
    described = {
        **yaml.safe_load(file.read_text()),
        'sands': sands,
        'sand_layers': [{'sand': 'silt', 'top_m': 0.5 * rig.height_m}, {'sand': 'coarse'}],
    }
    for key in ('porosity', 'permeability_m2', 'hydraulic_conductivity_m_s'):
        described.pop(key, None)
    named = parse_rig(described, file)
    assert sand_names(named, grid, layers(28)) == ('silt or washed silt', 'coarse')
