"""The rates of an experiment as its description changes them: at the pumps, and in the sand."""

from collections.abc import Callable
from dataclasses import replace

from porotwin_core.model.effect_parameter import onset
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.coefficients.tubes import through_tubes
from porotwin_solver.effects import described_physics, rig_at


def rates_of_pumps(rig: Rig, schedule: Schedule) -> Schedule:
    """Return the rates that leave the bottles of `rig` by a `schedule`.

    Raises:
        InputError: the model refuses an effect of the rig, or the rig has no such well.
    """
    return _changed(rig, schedule, Physics.pumped) if rig.effects else schedule


def rates_into_sand(rig: Rig, schedule: Schedule) -> Schedule:
    """Return the rates and concentrations that reach the sand of `rig` by a `schedule`.

    A free run has the same: pumps deliver another share, bottles are weaker, tubes hold water.

    Raises:
        InputError: as `rates_of_pumps`.
    """
    if not rig.effects:
        return schedule
    physics = described_physics(rig, rig.default_grid())
    return _changed(rig, through_tubes(schedule, physics), Physics.injected)


def _changed(
    rig: Rig, schedule: Schedule, change: Callable[[Physics, WellRates], WellRates]
) -> Schedule:
    """Return `schedule` with the `change` by the effects that act at each time."""
    grid = rig.default_grid()
    begins = sorted({0.0, *map(onset, rig.effects)})
    models = [described_physics(rig_at(rig, time), grid) for time in begins]
    first = min((row.time for row in schedule.rows), default=0.0)
    times = sorted({*(row.time for row in schedule.rows), *(one for one in begins if one > first)})
    changed = Schedule.from_rates(
        (time, change(models[sum(begin <= max(time, 0.0) for begin in begins) - 1], now))
        for time in times
        if (now := schedule.at(time))
    )
    return replace(changed, levels=schedule.levels)
