"""Water, dissolved CO2 and gas in rendered photographs."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import conservative_resample
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.phases.colour_change import Box
from porotwin_imaging.phases.phase_colours import DISSOLVED, GAS, UNKNOWN, WATER
from porotwin_imaging.phases.phase_study import PhaseStudy

BLUE, YELLOW, DRY = (0.45, 0.25, 0.10), (0.05, 0.10, 0.50), (-0.30, -0.28, -0.25)
"""Absorption of red, green and blue by water, by dissolved CO2, and by dry sand."""
GAS_BOX = Box(0.37, 0.26, 0.43, 0.32)
DISSOLVED_BOX = Box(0.37, 0.11, 0.43, 0.15)


class Co2Laboratory:
    """Renders the three phases: a disc of gas in a disc of dissolved CO2."""

    def __init__(self, laboratory, make_plume, make_jpeg, true_shape) -> None:
        self.laboratory, self._jpeg = laboratory, make_jpeg
        self.dissolved = make_plume(true_shape, 0.4, 0.25, 0.17)
        self.gas = make_plume(true_shape, 0.4, 0.29, 0.08)

    def photograph(self, growth: float, seed: int = 9) -> bytes:
        """Return a photograph; at `growth` 0 there is only water, at 1 there are both phases."""
        light = self.laboratory.scene(np.zeros((2, 2)))
        rows, columns = self.dissolved.shape
        inside = (slice(150, 150 + rows), slice(40, 40 + columns))
        state, gas = (growth * part[::-1, :, None] for part in (self.dissolved, self.gas))
        colour = (1 - gas) * ((1 - state) * np.array(BLUE) + state * np.array(YELLOW))
        light[inside] *= np.exp(-colour - gas * np.array(DRY))
        return self._jpeg(light, seed=seed)

    def truth(self, shape: tuple[int, int]) -> np.ndarray:
        """Return the true phases on a map of `shape`."""
        dissolved, gas = (conservative_resample(p, shape) for p in (self.dissolved, self.gas))
        return np.where(gas > 0.5, GAS, np.where(dissolved > 0.5, DISSOLVED, WATER))


@pytest.fixture(scope='module')
def co2(laboratory, make_plume, make_jpeg, true_shape) -> Co2Laboratory:
    return Co2Laboratory(laboratory, make_plume, make_jpeg, true_shape)


@pytest.fixture(scope='module')
def last(co2) -> bytes:
    return co2.photograph(1.0)


@pytest.fixture(scope='module')
def water_baseline(co2):
    rig = co2.laboratory.rig
    return make_baseline(rig, rig.grid(90, 50), [co2.photograph(0.0, seed=1)])


def study(baseline, photograph, **boxes) -> PhaseStudy:
    numbers = {'gas': GAS, 'dissolved': DISSOLVED, 'water': WATER}
    given = {numbers[name]: found for name, found in boxes.items()}
    return PhaseStudy.of({60.0: lambda: photograph}, baseline, given)


@pytest.mark.parametrize(
    'boxes', [{}, {'gas': [GAS_BOX], 'dissolved': [DISSOLVED_BOX]}], ids=['found', 'given']
)
def test_each_phase_is_where_it_is(co2, last, water_baseline, boxes) -> None:
    found = study(water_baseline, last, **boxes).phases(last)
    known = found.phase != UNKNOWN
    truth = co2.truth(found.phase.shape)
    assert known.mean() > 0.95
    for phase in (WATER, DISSOLVED, GAS):
        both = ((found.phase == phase) & (truth == phase) & known).sum()
        either = (((found.phase == phase) | (truth == phase)) & known).sum()
        assert both / either > 0.93
    wrong = known & (found.phase != truth)
    assert found.confidence[wrong].mean() < found.confidence[known & ~wrong].mean() - 0.1


def test_water_alone_is_refused_and_named(co2, water_baseline) -> None:
    with pytest.raises(InputError, match='nothing has changed its colour'):
        study(water_baseline, co2.photograph(0.0, seed=2))


def test_exchanged_boxes_are_refused(last, water_baseline) -> None:
    with pytest.raises(InputError, match='exchange the two'):
        study(water_baseline, last, gas=[DISSOLVED_BOX], dissolved=[GAS_BOX])


def test_a_box_of_water_is_no_gas(last, water_baseline) -> None:
    with pytest.raises(InputError, match='which is water'):
        study(water_baseline, last, gas=[Box(0.7, 0.1, 0.8, 0.2)])


def test_two_boxes_of_one_phase_are_refused(last, water_baseline) -> None:
    with pytest.raises(InputError, match='have the same colour'):
        study(water_baseline, last, gas=[GAS_BOX], dissolved=[GAS_BOX])


def test_a_phase_without_a_box_is_not_looked_for(last, water_baseline) -> None:
    found = study(water_baseline, last, gas=[GAS_BOX])
    assert found.missing() == ['dissolved']
    assert not (found.phases(last).phase == DISSOLVED).any()


def test_no_photograph_that_can_be_used_is_told(water_baseline) -> None:
    with pytest.raises(InputError, match='no photograph can be used'):
        study(water_baseline, b'nothing')
