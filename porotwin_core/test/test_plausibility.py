"""Tests of plausible ranges: the message asks for a unit that makes the number usual."""

import pytest

from porotwin_core.basis import plausibility
from porotwin_core.basis.plausibility import (
    PlausibleRange,
    extent_remark,
    plausible_rate_ml_h,
    rate_remark,
)

RANGES = [value for value in vars(plausibility).values() if isinstance(value, PlausibleRange)]
SMALL_RIG_PORES = 1.97e-3


@pytest.mark.parametrize(
    ('plausible', 'value', 'guess', 'refused'),
    [
        (plausibility.PERMEABILITY, 665.0, '665 darcy = 6.56e-10 m2', True),
        (plausibility.PERMEABILITY, 6.4e-3, '0.0064 m/s (a hydraulic conductivity)', True),
        (plausibility.PERMEABILITY, 5e-8, '5e-08 cm2 = 5e-12 m2', False),
        (plausibility.DEPTH, 10.0, '10 mm = 0.01 m', True),
        (plausibility.WIDTH, 934.0, '934 mm = 0.934 m', True),
        (plausibility.WIDTH, 93.4, '93.4 cm = 0.934 m', True),
        (plausibility.VISCOSITY, 1.0, '1 mPa s = 0.001 Pa s', True),
        (plausibility.VISCOSITY, 1e-6, 'a kinematic viscosity', True),
        (plausibility.DENSITY, 1.0, '1 g/cm3 = 1e+03 kg/m3', True),
        (plausibility.POROSITY, 37.5, '37.5 percent = 0.375', True),
        (plausibility.POROSITY, 0.1, 'correct the number', False),
        (plausibility.CONDUCTIVITY, 550.0, '550 m/day', True),
        (plausibility.WIDTH, 9.2, '9.2 feet = 2.8 m', False),
        (plausibility.WELL_RADIUS, 0.5, 'mm or cm or inches? 0.5 mm = 0.0005 m', True),
        (plausibility.WELL_RADIUS, 4.0, '4 mm = 0.004 m', True),
    ],
)
def test_an_unusual_number_is_explained(
    plausible: PlausibleRange, value: float, guess: str, refused: bool
) -> None:
    remark = plausible.remark('key', value)
    assert remark is not None
    assert guess in str(remark)
    assert remark.refused is refused
    assert '\n' not in str(remark)


@pytest.mark.parametrize('plausible', RANGES, ids=lambda found: found.known)
def test_every_range_has_a_source_and_encloses_the_usual_values(plausible: PlausibleRange) -> None:
    assert plausible.source
    assert plausible.possible[0] <= plausible.usual[0] < plausible.usual[1] <= plausible.possible[1]
    assert plausible.remark('key', plausible.usual[0]) is None


def test_the_sands_of_both_rigs_are_usual() -> None:
    for permeability in (4.3e-11, 6.57e-10, 9.5e-9):
        assert plausibility.PERMEABILITY.remark('permeability_m2', permeability) is None


@pytest.mark.parametrize(
    ('rate', 'words', 'refused'),
    [
        (5e8, 'hold 1.97e+03 ml', True),
        (-5e8, 'hold 1.97e+03 ml', True),
        (5e4, 'hold 1.97e+03 ml', False),
        (5.6e-8, 'was this in m3/s? 5.6e-08 m3/s = 201.6 ml/h', False),
        (1e-15, 'write 0', False),
    ],
)
def test_an_unusual_rate_is_explained(rate: float, words: str, refused: bool) -> None:
    remark = rate_remark('rate_ml_h', rate, SMALL_RIG_PORES)
    assert remark is not None
    assert words in str(remark)
    assert remark.refused is refused


@pytest.mark.parametrize('rate', [0.0, 500.0, -2000.0, 1.0])
def test_a_usual_rate_needs_no_remark(rate: float) -> None:
    assert rate_remark('rate_ml_h', rate, SMALL_RIG_PORES) is None
    assert plausible_rate_ml_h(SMALL_RIG_PORES)[1] == pytest.approx(197_000)


def test_a_small_permeability_may_be_clay() -> None:
    low = plausibility.PERMEABILITY.remark('sands.clay.permeability_m2', 1e-14)
    assert low is not None
    assert str(low).endswith('correct the number, unless it is clay')


@pytest.mark.parametrize(
    ('last_min', 'is_odd'),
    [(63.0, False), (70.0, False), (30.0, False), (0.0, False), (1.05, True), (3780.0, True)],
)
def test_changes_that_do_not_suit_the_experiment_are_odd(last_min: float, is_odd: bool) -> None:
    assert (extent_remark('rates.csv', last_min, 63.0, 'seconds') is not None) is is_odd
