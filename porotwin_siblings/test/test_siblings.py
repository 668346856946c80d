"""Tests of the siblings: their learning, their bands, and the places of their work."""

import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from siblings_examples import EMPTY, GRID, RATES, RIG, period, photograph

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.delivered_rates import PumpFactor
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import Rig
from porotwin_siblings.course import CourseOrder, run_course, sibling_physics
from porotwin_siblings.expected_cost import chosen_judges
from porotwin_siblings.learning import Learning
from porotwin_siblings.outlook import Outlook, answers
from porotwin_siblings.photograph import Photograph
from porotwin_siblings.siblings import Siblings
from porotwin_siblings.unknowns import Sibling, Unknowns
from porotwin_solver.effects.dispersion import MOST_BELIEVED_M
from porotwin_solver.effects.permeability import EFFECT as PERMEABILITY
from porotwin_solver.effects.rate import EFFECT as RATE

PLAN = [RateStep(0.0, RATES)]
TIMES = (600.0, 1200.0, 2400.0)


def truth(factors: dict[str, float], times: list[float]) -> np.ndarray:
    """Return the maps (times, nz, nx) of a rig whose pumps deliver other rates."""
    pumps = tuple(RATE.described(well=well, factor=value) for well, value in factors.items())
    order = CourseOrder(
        RIG,
        GRID,
        Sibling(pumps, photograph_error=0.0),
        EMPTY,
        (period(0.0, times[-1]),),
        None,
        (),
        tuple(times),
    )
    return run_course(order).maps


def followed(
    executor: Executor,
    factors: dict[str, float],
    pumps: dict[str, PumpFactor] | None = None,
    *,
    end: float = 1500.0,
    step: float = 300.0,
) -> Siblings:
    """Return siblings that saw a rig with other rate factors until `end` [s].

    The hub told them of the `pumps`; None: nothing.
    """
    siblings = Siblings(RIG, GRID, executor=executor)
    siblings.observe(photograph(0.0, EMPTY))
    times = list(np.arange(step, end + 1.0, step))
    for time, map_ in zip(times, truth(factors, times), strict=True):
        siblings.observe(photograph(time, map_), [period(time - step, time)], pumps or {})
    return siblings


def believed(siblings: Siblings, well: str) -> tuple[float, float]:
    """Return mean and deviation of the log of a rate factor, over all siblings."""
    logs = np.log([one.rate_factors[well] for one in siblings.learning.members()])
    return float(logs.mean()), float(logs.std())


def test_a_pump_without_doubt_can_be_doubted_again() -> None:
    learning = Learning(Unknowns.of(RIG), GRID, 32)
    before = learning.belief
    for deviation in (1e-12, 1e-300, 0.03):
        learning.believe({'injector': PumpFactor(0.9, deviation, 1.0)})
        assert np.isfinite([*learning.mean().rate_factors.values()]).all()
    place, step = learning._unknowns.pumps['injector']
    assert learning.belief.deviation[place] * step == pytest.approx(0.03 / 0.9)
    learning.belief = learning._prior = replace(
        before, covariance=np.full_like(before.covariance, np.nan)
    )
    learning.begin_anew()
    np.testing.assert_allclose(learning.belief.covariance, before.covariance)


def test_an_effect_acts_from_its_onset_on() -> None:
    def course(rig: Rig, initial: np.ndarray, start: float, end: float) -> np.ndarray:
        sibling = Sibling(photograph_error=0.0)
        order = CourseOrder(rig, GRID, sibling, initial, (period(start, end),), map_times=(end,))
        return run_course(order).maps[0]

    late, always = (
        RIG.with_effects([RATE.described(well='injector', factor=2.0, since=since)])
        for since in (900.0, 0.0)
    )
    before = course(RIG, EMPTY, 0.0, 900.0)
    np.testing.assert_array_equal(course(late, EMPTY, 0.0, 900.0), before)
    whole, parts = course(late, EMPTY, 0.0, 1800.0), course(always, before, 900.0, 1800.0)
    np.testing.assert_allclose(whole, parts, atol=1e-6)
    assert whole.sum() > 1.2 * course(RIG, EMPTY, 0.0, 1800.0).sum()


@pytest.fixture(scope='module')
def threads() -> Executor:
    return ThreadPoolExecutor(2)


@pytest.fixture(scope='module')
def ordinary(threads: Executor) -> Siblings:
    """Siblings that saw a rig as it is described; tests ask for outlooks, which change nothing."""
    return followed(threads, {}, end=600.0)


def test_siblings_believe_of_pumps_what_the_hub_does_whatever_photographs_show(
    threads: Executor,
) -> None:
    siblings = followed(
        threads, {'injector': 0.92}, {'injector': PumpFactor(0.8, 0.024, 1.0)}, end=600
    )
    spread = siblings.learning.inflation
    assert believed(siblings, 'injector') == pytest.approx((np.log(0.8), 0.03 * spread))
    assert believed(siblings, 'control3') == pytest.approx((0.0, 0.06 * spread))
    learnt = siblings.learning.belief.mean.copy()
    assert np.abs(learnt[len(RIG.wells) :]).max() > 0.1
    siblings.observe(photograph(630.0, siblings.state), [period(600.0, 630.0)])
    assert believed(siblings, 'injector') == pytest.approx((0.0, 0.06 * spread))


def test_a_meter_acts_on_commands_and_not_on_measured_rates(threads: Executor) -> None:
    def expected(pump: PumpFactor) -> float:
        siblings = followed(threads, {}, {'injector': pump}, end=300.0)
        return float(siblings.outlook(PLAN, 1200.0, (1200.0,)).zone_tracer[1, 0])

    metered, told = PumpFactor(0.8, 0.04, 0.8), PumpFactor(1.0, 0.05, 1.0)
    assert expected(metered) < expected(told)
    siblings = followed(threads, {}, {'injector': metered}, end=300.0)
    assert believed(siblings, 'injector')[0] == pytest.approx(0.0)


def test_the_truth_lies_in_the_bands(threads: Executor) -> None:
    siblings = followed(threads, {'injector': 1.06}, {'injector': PumpFactor(1.05, 0.02, 1.0)})
    outlook = siblings.outlook(PLAN, 2400.0, TIMES)
    later = truth({'injector': 1.06}, [1500.0 + time for time in TIMES])
    for number, map_ in enumerate(later):
        low, _, high = outlook.zone_tracer[:, number]
        assert low <= siblings.zone.tracer(map_) <= high


def place_of(name: str, siblings: Siblings) -> int:
    listed = siblings.unknowns.listed
    return [f'{one.candidate.label} {one.parameter.name}' for one in listed].index(name)


def test_the_flow_between_reservoirs_is_learnt(threads: Executor) -> None:
    sides = {'left': 'open', 'right': 'open', 'top': 'closed', 'bottom': 'closed'}
    heads = {'left': 0.565, 'right': 0.562}
    boundaries = RIG.boundaries.model_validate({**sides, 'heads_m': heads})
    rig = RIG.model_copy(update={'boundaries': boundaries})
    times = [300.0 * (number + 1) for number in range(8)]
    true = Sibling((PERMEABILITY.described(factor=1.5),), photograph_error=0.0)
    periods = (period(0.0, times[-1]),)
    order = CourseOrder(rig, GRID, true, EMPTY, periods, None, (), tuple(times))
    siblings = Siblings(rig, GRID, executor=threads)
    name = 'permeability factor'
    with pytest.raises(ValueError, match=name):  # wells alone drive the same flow in any sand
        place_of(name, Siblings(RIG, GRID, executor=threads))
    siblings.observe(photograph(0.0, EMPTY))
    for time, map_ in zip(times, run_course(order).maps, strict=True):
        siblings.observe(photograph(time, map_), [period(time - 300.0, time)])
    place = place_of(name, siblings)
    belief, step = siblings.learning.belief, siblings.unknowns.listed[place].parameter.step
    assert step * belief.mean[place] > np.log(1.2)  # the rest is taken for a drift
    true_steps = np.log(1.5) / step
    assert belief.mean[place] == pytest.approx(true_steps, abs=2.5 * belief.deviation[place])


def test_bands_widen_and_the_zone_is_never_left_again(ordinary: Siblings) -> None:
    outlook = ordinary.outlook(PLAN, 2400.0, TIMES, (2400.0,))
    width = outlook.zone_tracer[2] - outlook.zone_tracer[0]
    assert width[0] <= width[-1]
    assert (np.diff(outlook.zone_reached) >= 0.0).all()
    assert outlook.mean.shape == outlook.deviation.shape == (1, *GRID.shape)
    assert 0.0 <= outlook.mean.min() <= outlook.mean.max() <= 1.0
    assert sorted(outlook.ranked) == list(range(32))


def test_a_few_siblings_answer_for_all(ordinary: Siblings) -> None:
    everyone = ordinary.outlook(PLAN, TIMES[-1], TIMES)
    few = chosen_judges(everyone.ranked, answers(32, TIMES[-1]))
    found = ordinary.outlook(PLAN, TIMES[-1], TIMES, numbers=few)
    assert sorted(found.ranked) == sorted(few)
    width = everyone.zone_tracer[2, -1] - everyone.zone_tracer[0, -1]
    np.testing.assert_allclose(
        found.zone_tracer[:, -1], everyone.zone_tracer[:, -1], atol=0.25 * width
    )


def test_the_longer_the_time_the_fewer_answer() -> None:
    assert [answers(32, horizon) for horizon in (600.0, 2700.0, 4050.0, 86400.0)] == [16, 16, 10, 8]
    assert answers(4, 600.0) == 4


def test_water_beside_the_plume_changes_what_is_expected(ordinary: Siblings) -> None:
    other = {**RATES, 'control2': WellRate(5e-7), 'producer': WellRate(-7e-7)}
    present = ordinary.outlook(PLAN, 2400.0, TIMES)
    proposed = ordinary.outlook([*PLAN, RateStep(300.0, other)], 2400.0, TIMES)
    assert abs(proposed.zone_tracer[1, -1] - present.zone_tracer[1, -1]) > 1e-7


def test_an_unknown_cause_spreads_the_siblings(threads: Executor) -> None:
    siblings = followed(threads, {}, end=600.0)
    assert siblings.learning.inflation == 1.0
    wrong = np.roll(siblings.state, 3, axis=1)
    siblings.observe(photograph(900.0, wrong), [period(600.0, 900.0)])
    assert siblings.learning.inflation > 1.0


def test_a_photograph_that_hides_nearly_all_sand_tells_nothing(threads: Executor) -> None:
    fine = RIG.grid(96, 56)
    siblings = Siblings(RIG, GRID, executor=threads, map_grid=fine)
    siblings.observe(photograph(0.0, np.zeros(fine.shape)))
    hidden = np.full(fine.shape, np.nan)
    hidden[3, 3] = 0.0
    siblings.observe(Photograph.of(300.0, hidden), [period(0.0, 300.0)])
    assert siblings.time == 300.0
    assert siblings.learning.inflation == 1.0
    np.testing.assert_array_equal(siblings.learning.belief.mean, 0.0)


def test_an_interruption_keeps_what_was_learnt(threads: Executor) -> None:
    siblings = followed(threads, {'injector': 0.92}, end=900.0)
    learnt = siblings.learning.belief.mean
    siblings.interrupt()
    assert not siblings.started
    with pytest.raises(InputError, match='no photograph has come yet'):
        siblings.outlook(PLAN, 600.0, (600.0,))
    assert siblings.learning.belief.mean is learnt
    assert learnt.any()
    siblings.begin_anew()
    assert not siblings.learning.belief.mean.any()


def outlook_of(executor: Executor) -> Outlook:
    siblings = Siblings(RIG, GRID, executor=executor)
    siblings.observe(photograph(0.0, EMPTY))
    return siblings.outlook(PLAN, 1200.0, (600.0, 1200.0))


class Elsewhere(Executor):
    """Runs everything at once on copies, as another process would get them."""

    def map(self, function: Callable[..., Any], *items: Any, **_: Any) -> Iterator[Any]:
        copies = pickle.loads(pickle.dumps((function, [list(one) for one in items])))
        return iter(pickle.loads(pickle.dumps(list(map(copies[0], *copies[1])))))


def test_other_processes_and_threads_give_the_same_numbers(threads: Executor) -> None:
    np.testing.assert_array_equal(
        outlook_of(Elsewhere()).zone_tracer, outlook_of(threads).zone_tracer
    )


@pytest.mark.slow
def test_a_dask_client_gives_the_same_numbers(threads: Executor) -> None:
    distributed = pytest.importorskip('distributed')
    with distributed.Client(processes=False, n_workers=1, dashboard_address=None) as client:
        executor = client.get_executor()
        np.testing.assert_array_equal(
            outlook_of(executor).zone_tracer, outlook_of(threads).zone_tracer
        )


@pytest.mark.parametrize(
    ('wrong', 'complaint'),
    [
        ({'time': np.nan}, 'its time is nan s'),
        ({'concentration': np.full(GRID.shape, np.nan)}, 'its map shows no cell'),
        ({'random': np.full(GRID.shape, np.nan)}, 'a deviation of its map is not finite'),
        ({'systematic': np.full(GRID.shape, np.inf)}, 'a deviation of its map is not finite'),
    ],
)
def test_a_photograph_that_tells_nothing_is_refused(
    wrong: dict[str, Any], complaint: str, threads: Executor
) -> None:
    siblings = Siblings(RIG, GRID, executor=threads)
    with pytest.raises(InputError, match=complaint):
        siblings.observe(photograph(0.0, EMPTY)._replace(**wrong))
    assert not siblings.started


def test_photographs_that_contradict_the_rates_lead_to_courses_that_end(threads: Executor) -> None:
    siblings = Siblings(RIG, GRID, executor=threads)
    siblings.observe(photograph(0.0, EMPTY))
    siblings.observe(photograph(300.0, EMPTY), [period(0.0, 300.0)])  # no tracer came
    spread = [
        sibling_physics(RIG, GRID, one).longitudinal_dispersivity
        for one in siblings.learning.members()
    ]
    assert max(spread) == pytest.approx(MOST_BELIEVED_M)  # it was kilometres
    assert siblings.outlook(PLAN, 600.0, (600.0,)).zone_tracer.shape == (3, 1)
