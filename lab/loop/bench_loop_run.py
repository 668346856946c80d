"""The runs of a scenario that the loop bench compares."""

from itertools import pairwise

from lab.loop.bench_loop_optimum import optimum_schedules, play
from porotwin_cli.running.loop_rig import LoopSettings
from porotwin_cli.running.loop_run import LoopFigures, MakeTwin, figures_of, planning_twin
from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_core.rates.rate_periods import same_rates
from porotwin_core.rates.wells import Schedule
from porotwin_hub.control.controller import Controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import no_correction
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_solver.model.model import Model

EVALUATIONS = 60
"""Most predictions of one search for constant rates."""


def paper_twin(scenario: LoopScenario, settings: LoopSettings) -> Twin:
    """Return the loop of the paper (section 4): COBYLA, constant rates, one interval ahead."""
    grid = settings.grid(scenario)
    return Twin(
        Model(scenario.rig, grid, preset=settings.preset),
        no_correction,
        photo_interval=scenario.photo_interval,
        controller=Controller(
            Limits.of(scenario.rig),
            make_objective(scenario.rig, grid),
            horizon=scenario.photo_interval,
            evaluations=EVALUATIONS,
        ),
    )


TWINS: dict[str, MakeTwin] = {
    'paper': paper_twin,
    'twin': planning_twin,
}
"""The closed loops that are compared, by name."""

RUNS = ('none', *TWINS, 'optimum')
"""All runs of a scenario: without control, the closed loops, the best schedule found offline."""


def run_free(scenario: LoopScenario, settings: LoopSettings) -> LoopFigures:
    """Return the figures without control: the safe rates all the time."""
    safe = Schedule.constant(Limits.of(scenario.rig).safe())
    return figures_of(play(scenario, safe, settings))


def run_optimum(scenario: LoopScenario, settings: LoopSettings) -> LoopFigures:
    """Return the figures of the best schedule found offline, as the virtual rig plays it."""
    played = [
        (play(scenario, schedule, settings), schedule) for schedule in optimum_schedules(scenario)
    ]
    best, schedule = min(played, key=lambda pair: pair[0].dose_ml_min)
    moments = sorted({row.time for row in schedule.rows})
    rates = [Limits.of(scenario.rig).safe(), *map(schedule.at, moments)]
    orders = sum(not same_rates(before, after) for before, after in pairwise(rates))
    return figures_of(best, orders=orders)
