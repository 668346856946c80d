"""The best schedule of a scenario found offline, with the hidden effects and faults known.

It is the bound that a controller is compared with, with the same person at the pumps. Simple plans
are tried, the best ones are improved by SLSQP on the solver's adjoint, and the virtual rig then
plays the results, because it has numerics of its own.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from lab.loop.bench_loop_dose import Plan, ScenarioDose, simple_plans
from porotwin_cli.running.loop_operator import Operator, OperatorAtWork
from porotwin_cli.running.loop_rig import LoopRig, LoopSettings
from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_hub.control.setpoint_limits import Limits

PIECE_S = 480.0
"""Length of a piece of constant rates [s]: shorter ones hardly lower the dose."""

SWITCHES = (0.25, 0.5, 0.75)
"""Shares of the time after which a simple plan goes over to another well."""

IMPROVED = 2
"""Simple plans that are improved."""

STEPS = 25
"""Most steps of one search."""


def optimum_schedules(scenario: LoopScenario) -> Iterator[Schedule]:
    """Yield good schedules of the control wells: the best simple one, and improved ones.

    They begin when the person of the scenario sets a first order. Later orders can be given ahead,
    so that no other order waits for the person.
    """
    limits = Limits.of(scenario.rig)
    missed = photographs_until_set(scenario.operator, limits, seed=scenario.seed)
    scenario = replace(scenario, start=scenario.start + missed * scenario.photo_interval)
    dose = ScenarioDose(scenario)
    constant, switched = simple_plans(dose.limits, dose.duration, SWITCHES)
    plans = sorted(constant + switched, key=dose.dose)
    yield _schedule(scenario, dose, plans[0])
    for plan in plans[:IMPROVED]:
        yield _schedule(scenario, dose, improved(dose, plan, piece=PIECE_S))


def photographs_until_set(operator: Operator, limits: Limits, *, seed: int) -> int:
    """Return after how many photographs a person sets the first order of an experiment.

    No twin can change this: the person is late, or refuses for a while.
    """
    person = OperatorAtWork(operator, limits, seed=seed)
    order = limits.setpoint(np.full(len(limits.wells), limits.max_total_rate / len(limits.wells)))
    return next(count for count in itertools.count() if person.follow(order)[1])


def play(scenario: LoopScenario, schedule: Schedule, settings: LoopSettings) -> LoopRig:
    """Return the rig after the experiment under `schedule`, set at its times and as it says."""
    rig = LoopRig(scenario, settings)
    while not rig.is_over:
        rig.advance(schedule.at(rig.time))
    return rig


def improved(dose: ScenarioDose, plan: Plan, *, piece: float) -> Plan:
    """Return the plan of least dose near `plan`, in pieces of about `piece` [s]; or `plan`."""
    count = max(1, round(dose.duration / piece))
    starts = np.linspace(0.0, dose.duration, count, endpoint=False)
    held = np.searchsorted(plan.starts, starts + 0.5 * dose.duration / count, side='right') - 1
    begin = plan.rates[held] / dose.limits.max_rate
    shape = begin.shape
    scale = max(dose.cost(Plan(starts, plan.rates[held]))[0], 1e-6)

    def on_pieces(shares: FloatArray) -> Plan:
        inside = np.clip(shares.reshape(shape), 0.0, 1.0)
        most = dose.limits.max_total_rate / dose.limits.max_rate
        inside = inside / np.maximum(1.0, inside.sum(axis=1, keepdims=True) / most)
        return Plan(starts, inside * dose.limits.max_rate)

    def cost(shares: FloatArray) -> tuple[float, FloatArray]:
        value, slope = dose.cost(on_pieces(shares))
        return value / scale, slope.ravel() * dose.limits.max_rate / scale

    sums = np.kron(np.eye(count), np.ones(shape[1]))
    most = dose.limits.max_total_rate / dose.limits.max_rate
    found = minimize(
        cost,
        begin.ravel(),
        jac=True,
        method='SLSQP',
        bounds=[(0.0, 1.0)] * begin.size,
        constraints=[LinearConstraint(sums, -np.inf, most)],
        options={'maxiter': STEPS, 'ftol': 1e-3},
    )
    return min((plan, on_pieces(found.x)), key=dose.dose)


def _schedule(scenario: LoopScenario, dose: ScenarioDose, plan: Plan) -> Schedule:
    """Return the commands of a plan as the pumps can be set, at whole photo intervals."""
    step = scenario.photo_interval
    rows = [(0.0, dose.limits.safe())] if scenario.start > 0.0 else []
    for start, rates in zip(plan.starts, plan.rates, strict=True):
        moment = scenario.start + step * round(float(start) / step)
        rows.append((moment, dose.limits.setpoint(rates)))
    return Schedule.from_rates(rows)
