"""The hub, the siblings, the mending, the diagnosis, a bag and COSTA believe the same rates.

Over random courses of orders, confirmations, meters, pauses and lost photographs, all inject the
same volume. Times of confirmations and meters lie between two photographs, so that nobody answers
before something is told.
"""

import random
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from recording_examples import write_live_bag

from porotwin_core.clock.photo_interval import VALIDITY_INTERVALS
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import KnownRates, RatePeriod
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig, load_rig
from porotwin_core.ros.conversions import header_at, rates_to_msg, rig_to_msg, time_to_msg
from porotwin_costa.data.collector import Collector
from porotwin_diagnosis.data.live_run import LiveRun
from porotwin_diagnosis.mending.state_periods import StatePeriods
from porotwin_hub.control.optimisation import Decision
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import no_correction
from porotwin_msgs.msg import Setpoint
from porotwin_msgs.msg import WellRates as WellRatesMessage
from porotwin_recording.experiment.recording import open_recording
from porotwin_siblings.continuity import periods_until

RIG = load_rig(Path(__file__).resolve().parents[1] / 'rigs' / 'small' / 'rig.yaml')
GRID = RIG.grid(6, 4)
INTERVAL = 30.0
EMPTY = np.zeros(GRID.shape)


class Photograph(NamedTuple):
    """The known rates before a photograph at `time` [s], and the order after it."""

    time: float
    known: list[KnownRates]
    order: WellRates

    @property
    def ends(self) -> float:
        return self.time + VALIDITY_INTERVALS * INTERVAL


def course(seed: int, *, untold: float = 0.0, lost: float = 0.0, metered: float = 0.0):
    """Return random photographs of an experiment.

    Args:
        seed: of the course.
        untold: share of the orders that nobody confirms.
        lost: share of the photographs that begin a gap.
        metered: share of the intervals with a report of a meter.
    """
    chance, limits = random.Random(seed), Limits.of(RIG)
    time, order, known, found = 0.0, limits.safe(), [], []
    for number in range(60):
        told, before = known, order
        if number == 0 or chance.random() < 0.1:
            wanted = [chance.uniform(0.0, 0.5) * limits.max_rate for _ in limits.wells]
            order = limits.setpoint(np.array(wanted))
        found.append(Photograph(time, told, order))
        known = []
        if chance.random() < metered:
            begin = time + chance.uniform(1.0, 10.0)
            known.append(KnownRates(begin, begin + chance.uniform(5.0, 15.0), before))
        if order != before and chance.random() >= untold:
            at = time + chance.uniform(2.0, 25.0)
            known.append(KnownRates(at, at, order))
        time += INTERVAL * (chance.randint(4, 8) if chance.random() < lost else 1)
    return found


def injected(periods: list[RatePeriod]) -> float:
    """Return the volume of all injected water [m^3]."""
    return sum(
        (end - start) * max(well.rate, 0.0)
        for start, end, rates in periods
        for well in rates.values()
    )


class Still:
    """A model without motion."""

    def predict(self, concentration: FloatArray, *_: Any) -> FloatArray:
        return concentration

    def correct(self, previous: FloatArray, *_: Any) -> FloatArray:
        return previous


class Ordering:
    """Stands for the optimiser and its objective; gives the next order."""

    goal = 'test'

    def __init__(self, rig: Rig) -> None:
        self.limits, self.objective = Limits.of(rig), self
        self.order: WellRates = {}

    def disallowed_tracer(self, _: FloatArray) -> float:
        return 0.0

    def decide(self, *_: Any, **__: Any) -> Decision:
        return Decision(dict(self.order), cost=0.0, cost_unchanged=0.0, evaluations=0)


class Following:
    """Stands for the siblings."""

    started, time = False, 0.0

    def interrupt(self) -> None:
        raise AssertionError

    begin_anew = interrupt


def of_the_hub(rig: Rig, photographs: list[Photograph]) -> list[RatePeriod]:
    controller = Ordering(rig)
    twin = Twin(
        Still(),
        no_correction,
        photo_interval=INTERVAL,
        controller=controller,
        rates=RateHistory.of(rig),
    )
    found: list[RatePeriod] = []
    for one in photographs:
        controller.order = one.order
        found += twin.cycle(Observation(one.time, EMPTY), one.known).periods
    return found


def tell(rates: RateHistory, one: Photograph) -> None:
    """Tell the known rates before a photograph."""
    for known in one.known:
        rates.add_known(known)


def of_the_siblings(rig: Rig, photographs: list[Photograph]) -> list[RatePeriod]:
    rates, siblings = RateHistory.of(rig), Following()
    rates.reach(0.0)
    found: list[RatePeriod] = []
    for one in photographs:
        tell(rates, one)
        found += periods_until(one.time, siblings, rates, interrupted=False)
        siblings.started, siblings.time = True, one.time
        rates.add_commanded(one.time, one.order, one.ends)
    return found


def of_the_mending(rig: Rig, photographs: list[Photograph]) -> list[RatePeriod]:
    states, found = StatePeriods(rig), []
    for one in photographs:
        tell(states.rates, one)
        found += states.until(one.time)
        states.rates.add_commanded(one.time, one.order, one.ends)
    return found


def of_the_diagnosis(rig: Rig, photographs: list[Photograph], folder: Path) -> list[RatePeriod]:
    run = LiveRun(rig, GRID)
    for one in photographs:
        tell(run.rates, one)
        run.add_map(one.time, EMPTY, GRID)
        run.rates.add_commanded(one.time, one.order, one.ends)
    run.write(folder)
    schedule = open_recording(folder).delivered
    return [RatePeriod(*period) for period in schedule.intervals(0.0, photographs[-1].time)]


def of_a_bag(rig: Rig, photographs: list[Photograph], file: Path) -> list[RatePeriod]:
    messages: list[tuple[str, object]] = [('/lab/rig/description', rig_to_msg(rig))]
    for number, one in enumerate(photographs, start=1):
        for known in one.known:
            wells, start = rates_to_msg(known.rates), time_to_msg(known.start)
            told = WellRatesMessage(header=header_at(known.end), start=start, wells=wells)
            messages.append(('/lab/wells/measured', told))
        wells, until, header = rates_to_msg(one.order), time_to_msg(one.ends), header_at(one.time)
        order = Setpoint(header=header, sequence=number, valid_until=until, wells=wells)
        messages.append(('/lab/wells/setpoint', order))
    write_live_bag(file, messages)
    schedule = open_recording(file).delivered
    return [RatePeriod(*period) for period in schedule.intervals(0.0, photographs[-1].time)]


def of_costa(rig: Rig, photographs: list[Photograph]) -> list[RatePeriod]:
    """Return the mean rates of all pairs; photographs far apart make none."""
    rates, pairs = RateHistory.of(rig), []
    collector = Collector(rig, GRID, INTERVAL, rates)
    for one in photographs:
        tell(rates, one)
        pairs += collector.observed(one.time, EMPTY, GRID)
        rates.add_commanded(one.time, one.order, one.ends)
    pairs += collector.finished()
    return [RatePeriod(pair.end - INTERVAL, pair.end, pair.rates) for pair in pairs]


COURSES = {
    'all told': {},
    'one in five untold': {'untold': 0.2},
    'photographs lost': {'lost': 0.1},
    'metered': {'metered': 0.5},
    'expired untold': {'untold': 0.8, 'lost': 0.2},
    'all of it': {'untold': 0.2, 'lost': 0.1, 'metered': 0.5},
}


@pytest.mark.parametrize('pausing', [False, True])
@pytest.mark.parametrize('kind', COURSES)
def test_all_inject_the_same_volume(kind: str, pausing: bool, tmp_path: Path) -> None:
    rig = with_pause(RIG) if pausing else RIG
    for seed in range(4):
        photographs = course(seed, **COURSES[kind])
        periods = of_the_hub(rig, photographs)
        hub = injected(periods)
        assert injected(of_the_siblings(rig, photographs)) == pytest.approx(hub, rel=1e-9)
        assert injected(of_the_mending(rig, photographs)) == pytest.approx(hub, rel=1e-9)
        run = of_the_diagnosis(rig, photographs, tmp_path / str(seed))
        assert injected(run) == pytest.approx(hub, rel=1e-6)
        bag = of_a_bag(rig, photographs, tmp_path / f'{seed}.mcap')
        assert injected(bag) == pytest.approx(hub, rel=1e-6)
        pairs = of_costa(rig, photographs)
        ends = {pair.end for pair in pairs}
        within = [one for one in periods if ceil(one.end / INTERVAL) * INTERVAL in ends]
        assert injected(pairs) == pytest.approx(injected(within), rel=1e-9)


def with_pause(rig: Rig) -> Rig:
    assert rig.control is not None
    fixed = {
        name: well.model_copy(update={'pauses_min': ((5.0, 8.2),)})
        for name, well in rig.control.fixed.items()
    }
    control = rig.control.model_copy(update={'fixed': fixed})
    return rig.model_copy(update={'control': control})
