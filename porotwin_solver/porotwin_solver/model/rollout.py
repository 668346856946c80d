"""The states under a plan of rates, from any state."""

from collections.abc import Iterator, Sequence

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import RateStep, check_plan, plan_intervals
from porotwin_solver.coefficients.refinement import coarsen, refine
from porotwin_solver.model.engine import State
from porotwin_solver.model.model import Model


def rollout(
    model: Model, initial: FloatArray, plan: Sequence[RateStep], times: Sequence[float]
) -> Iterator[FloatArray]:
    """Return an iterator of the maps (nz, nx) at `times` [s] after the state `initial` (nz, nx).

    The state stays on the refined grid between the maps. Mobile and immobile water start from the
    same concentration. The supervision of the model bounds the whole run.

    Raises:
        InputError: NaN or another shape, times that do not increase, an unknown well, rates that do
            not balance in a closed rig, or the supervision refuses the cost.
    """
    start = model.validated_map(initial, 'initial')
    check_plan(plan)
    moments = [float(time) for time in times]
    if not moments or any(
        not low < high for low, high in zip([0.0, *moments], moments, strict=False)
    ):
        raise InputError('times: give at least one, in seconds after the state, increasing')
    engine = model.engine
    engine.supervision.refuse_too_long(moments[-1])
    state = State.equilibrium(refine(start, engine.grid.shape))
    engine.refuse_too_costly(state, plan, plan_intervals(plan, moments, moments[-1]))
    return _maps(model, state, plan, moments)


def _maps(
    model: Model, state: State, plan: Sequence[RateStep], times: Sequence[float]
) -> Iterator[FloatArray]:
    engine = model.engine
    wanted = set(times)
    for low, high, number in plan_intervals(plan, times, times[-1]):
        engine.advance(state, plan[number].rates, high - low)
        if high in wanted:
            yield coarsen(engine.mean_concentration(state), model.grid.shape)
