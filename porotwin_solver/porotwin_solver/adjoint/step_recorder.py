"""Steps that are recorded on the way forward, so that their adjoint need not run them again."""

from porotwin_solver.model.engine import Engine, State, StepCoefficients, StepRecord

MOST_KEPT_BYTES = 1e9
"""Most memory for the states that the adjoint keeps, and for the records [B]."""


def is_symmetric(engine: Engine, coefficients: StepCoefficients, *, varied: bool) -> bool:
    """Return whether the diffusion is its own adjoint for any state: the same one everywhere.

    `varied` tells that derivatives by parameters are wanted.
    """
    return coefficients.exchanges.to_neighbours and not varied and not engine.physics.disperses


class StepRecorder:
    """Does the steps of one run, and records them while there is memory."""

    def __init__(self, engine: Engine, *, varied: bool = False) -> None:
        """Record steps of `engine`; `varied` as of `is_symmetric`."""
        self._engine, self._varied, self._left = engine, varied, MOST_KEPT_BYTES
        self._latest: StepCoefficients | None = None

    def step(self, state: State, coefficients: StepCoefficients) -> StepRecord | None:
        """Do as `Engine.step`; return the record, or None: the adjoint runs the step again.

        Tapes of diffusion are long, so a step with them is not recorded, and no step on a device.
        """
        engine = self._engine
        recorded = self._left > 0.0 and not engine.on_device
        if not recorded or not is_symmetric(engine, coefficients, varied=self._varied):
            engine.step(state, coefficients)
            return None
        record = engine.recorded_step(state, coefficients, diffusion=False)
        self._left -= record.size
        if coefficients is not self._latest:  # steps at the same rates share theirs
            self._latest = coefficients
            self._left -= coefficients.size
        return record
