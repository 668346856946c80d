"""The twin when the pump of the tracer stops or changes and nobody tells: belief and words."""

from collections.abc import Callable

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_core.basis.units import ML
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.state_filter import StateFilter
from porotwin_core.rates.delivered_rates import RATE_DEVIATION
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_hub.estimation.rate_learning import RateLearner
from porotwin_hub.estimation.tracer_watch import TracerWatch
from porotwin_hub.loop.cycle import Cycle, Observation
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import no_correction

GRID = Grid(60, 8, 0.6, 0.08)
RIG = box_rig(**{'in': (0.005, 0.04)}).model_copy(update={'height_m': 0.08, 'depth_m': 0.015625})
PORES = RIG.cell_pore_volume(GRID)
INTERVAL = 4.0
STEP = 2.5e-6
TOLD = {'in': WellRate(STEP / INTERVAL, 1.0)}
NOISE = 0.01
STOP = 40
"""Last photograph before the pump stops."""


def front(place: float) -> FloatArray:
    """Return a column (nz, nx) with a smooth front at `place` [cells]."""
    return np.tile(1.0 / (1.0 + np.exp((np.arange(GRID.nx) - place) / 1.5)), (GRID.nz, 1))


PLACES = np.linspace(-20.0, 100.0, 2401)
HELD = np.array([np.sum(PORES * front(place)) for place in PLACES])


def plume(volume: float) -> FloatArray:
    """Return the column (nz, nx) that holds `volume` [m^3]."""
    return front(float(np.interp(volume, HELD, PLACES)))


class Column:
    """A model: tracer enters a column from the left and leaves by no well."""

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        held = float(np.sum(PORES * concentration))
        entered = rates['in'].rate * rates['in'].concentration * time_step
        return np.clip(concentration + plume(held + entered) - plume(held), 0.0, 1.0)

    def correct(self, *_: object) -> FloatArray:
        raise NotImplementedError


def followed(
    systematic: float, delivered: Callable[[int], float], count: int
) -> tuple[list[Cycle], list[float]]:
    """Return the cycles of a twin, and the volumes [m^3] in the sand.

    Args:
        systematic: relative systematic deviation of the photographs.
        delivered: share of its rate that the pump delivers before a photograph.
        count: of photographs.
    """
    generator = np.random.default_rng(5)
    twin = Twin(
        Column(),
        no_correction,
        photo_interval=INTERVAL,
        rates=RateHistory(TOLD),
        watch=TracerWatch(RIG, GRID),
        state_filter=StateFilter(PORES, (GRID.dz, GRID.dx)),
        learner=RateLearner({'in': RATE_DEVIATION}, GRID, closed=False),
    )
    volume, cycles, volumes = STEP, [], []
    for number in range(count):
        volume += STEP * delivered(number) if number else 0.0
        shown = plume(volume) + NOISE * generator.standard_normal(GRID.shape)
        known = systematic * np.clip(shown, 0.0, 1.0)
        seen = Observation(INTERVAL * number, shown, np.hypot(NOISE, known), known)
        cycles.append(twin.cycle(seen))
        volumes.append(volume)
    return cycles, volumes


def first_told(cycles: list[Cycle], words: str) -> int:
    """Return the number of the first cycle with a remark of these `words`."""
    return next(i for i, one in enumerate(cycles) if any(words in line for line in one.remarks))


@pytest.mark.parametrize(('systematic', 'most'), [(0.04, 5), (0.17, 10)])
def test_a_stopped_pump_is_told_in_a_few_photographs(systematic: float, most: int) -> None:
    cycles, volumes = followed(systematic, lambda number: float(number <= STOP), STOP + 12)
    assert STOP < first_told(cycles, 'in seems to deliver nothing') <= STOP + most
    assert cycles[-1].rate_factors['in'].factor < 0.05
    assert all(not one.remarks for one in cycles[:STOP])
    for cycle, volume in zip(cycles[STOP:], volumes[STOP:], strict=True):
        assert np.sum(PORES * cycle.state) == pytest.approx(volume, rel=systematic + 0.01)


@pytest.mark.parametrize('share', [0.5, 2.0])
@pytest.mark.parametrize(('systematic', 'most'), [(0.04, 6), (0.17, 12)])
def test_another_delivery_is_told_with_its_share(
    systematic: float, most: int, share: float
) -> None:
    cycles, _ = followed(systematic, lambda one: 1.0 if one <= STOP else share, STOP + most + 2)
    assert STOP < first_told(cycles, 'in seems to deliver about') <= STOP + most
    assert cycles[-1].rate_factors['in'].factor == pytest.approx(share, rel=0.1)
    assert all(not one.remarks for one in cycles[:STOP])


def test_a_pump_that_runs_again_is_told_in_a_few_photographs() -> None:
    again = STOP + 15
    cycles, volumes = followed(0.04, lambda one: float(one <= STOP or one > again), again + 12)
    assert again < first_told(cycles, 'in delivers again') <= again + 6
    assert cycles[-1].rate_factors['in'].factor == pytest.approx(1.0, abs=0.1)
    assert np.sum(PORES * cycles[-1].state) == pytest.approx(volumes[-1], rel=0.05)


def test_by_the_pumps_means_what_the_rates_tell_and_never_the_estimate() -> None:
    cycles, volumes = followed(0.04, lambda number: float(number <= STOP), STOP + 30)
    (told,) = [line for line in cycles[-1].remarks if 'by the pumps' in line]
    pumped = volumes[STOP] + 29 * STEP
    assert f'by the pumps it would be {pumped * ML:.3g} ml' in told
