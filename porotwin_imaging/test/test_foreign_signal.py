"""What tracer cannot make is left out with its share, or the photograph is refused."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.light.foreign_signal import without_foreign_signal
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.tracer.tracer_colour import TracerColour

SHAPE = (50, 100)
ALL = np.ones(SHAPE, bool)
COLOUR = TracerColour.of_absorbance((1.2, 0.7, 1.45))
SQUARE = (slice(20, 32), slice(40, 60))
"""5 % of the cells."""


def change(*colour: float) -> np.ndarray:
    """Return log ratios (50, 100, 3) with a square of another colour."""
    ratio = np.random.default_rng(4).normal(0, 0.01, (*SHAPE, 3))
    ratio[SQUARE] += colour
    return ratio


@pytest.mark.parametrize('amount', [0.05, 0.3, 1.0])
def test_tracer_is_kept(amount: float) -> None:
    ratio = change(*(-amount * np.array([1.2, 0.7, 1.45])))
    kept, remarks = without_foreign_signal(ratio, ALL, COLOUR)
    assert kept.all()
    assert remarks == []


@pytest.mark.parametrize(
    'colour',
    [
        pytest.param((0.5, -0.3, -0.2), id='red'),
        pytest.param((-0.3, -0.6, -0.2), id='opposite hue'),
        pytest.param((-0.4, -0.4, -0.4), id='hard shadow'),
        pytest.param((0.2, 0.2, 0.2), id='gas'),
        pytest.param((-0.6, -0.5, -0.1), id='yellow'),
    ],
)
def test_another_colour_is_left_out_with_its_share(colour: tuple[float, float, float]) -> None:
    kept, remarks = without_foreign_signal(change(*colour), ALL, COLOUR)
    assert not kept[SQUARE].any()
    assert 0.9 < kept.mean() < 0.95
    (line,) = remarks
    assert line.endswith(
        '% of the sand has a colour that tracer cannot make: this part is left out'
    )


def test_without_a_colour_the_sign_is_checked() -> None:
    assert without_foreign_signal(change(-0.4, -0.4, -0.4), ALL, None)[0].all()
    assert not without_foreign_signal(change(-0.4, 0.3, -0.4), ALL, None)[0][SQUARE].any()


def test_a_ph_indicator_is_no_clean_sand(baseline, laboratory, no_tracer, make_jpeg) -> None:
    light = laboratory.scene(no_tracer)
    rows, columns = np.mgrid[: light.shape[0], : light.shape[1]]
    acid = np.hypot(columns - 500, rows - 380) < 60
    light[acid] *= [1.5, 0.9, 0.6]
    found = concentration_map(make_jpeg(light), baseline)
    assert any('% of the sand has a colour that tracer cannot make' in s for s in found.status)
    assert found.suspicious
    assert np.isnan(found.values[20:28, 48:54]).all()
    acid = np.hypot(columns - 500, rows - 380) < 190
    light[acid] = laboratory.scene(no_tracer)[acid] * [1.5, 0.9, 0.6]
    with pytest.raises(InputError, match='tracer cannot'):
        concentration_map(make_jpeg(light), baseline)


def test_a_dark_line_through_cells_of_the_wrong_colour_is_left_out() -> None:
    ratio = np.random.default_rng(4).normal(0, 0.01, (*SHAPE, 3))
    ratio[10:30, 40:60] -= [1.2, 0.7, 1.45]  # a plume
    without = ratio.copy()
    ratio[24, 5:90] -= 0.8  # a tube fills a part of its cells
    ratio[24, 40:60] -= 0.3 * np.array([1.2, 0.7, 1.45])
    kept, remarks = without_foreign_signal(ratio, ALL, COLOUR)
    assert not kept[24, 5:90].any()
    assert kept.mean() > 0.85
    assert len(remarks) == 1
    assert without_foreign_signal(without, ALL, COLOUR)[0].all()


def test_grain_of_fine_cells_is_no_dark_line() -> None:
    grain = 0.1 * np.random.default_rng(1).standard_normal((60, 100, 1))
    ratio = np.repeat(grain, 3, axis=2)
    ratio[20:26, 30:36] -= 0.3 * np.array([1.2, 0.7, 1.45])
    kept, _ = without_foreign_signal(ratio, np.ones((60, 100), bool), COLOUR)
    assert kept.mean() > 0.9
