"""The models of the graph as plain callables: clients of their services.

A call blocks its thread until the answer is there, so it belongs in a worker thread while the
executor spins in another. A blocking call in a callback would deadlock.
"""

import math
import uuid
from collections.abc import Sequence
from typing import Any

import numpy as np
from rclpy.node import Node

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.correction import Correction
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import RateStep, WellRates
from porotwin_core.rig import Rig
from porotwin_core.ros import conversions
from porotwin_core.ros.senders import LONGEST_SEARCH_S
from porotwin_core.ros.service_answer import twin_answer_within
from porotwin_core.ros.vouching import CALLERS, Voucher
from porotwin_hub.models.forecast import ModelUnavailable
from porotwin_msgs.msg import Outcome, Setpoint, TracerField
from porotwin_msgs.srv import Cancel, Control, Correct, CorrectiveSource, CostGradient, Predict

CANCEL = 'solver/cancel'
"""The service that ends the predictions of one client of the solver."""

LEAST_PATIENCE_S = 0.5
"""Shortest wait for the cost of a plan [s]: a simulation on the grid of plans takes less."""

GUARD_PATIENCE_S = 15.0
"""Shortest wait for the guard [s]: it waits up to 12 s for the pumps, and what they took must not
count as refused."""

CANCEL_WAIT_S = 1.0
"""Longest wait for the answer of a cancel service [s]: a time step of the solver is shorter."""


class Caller:
    """Calls services by name from a worker thread, each call with a time limit."""

    def __init__(self, node: Node, *, timeout: float) -> None:
        """Use `node` for clients; a call that takes longer than `timeout` [s] has failed."""
        self._node = node
        self.timeout = timeout
        self.token = uuid.uuid4().hex
        """Marks the requests of this client, so that it can end its own and nobody else can."""
        self._clients: dict[str, Any] = {}
        self._voucher = Voucher(node)

    def __call__(
        self,
        service_type: Any,
        name: str,
        request: Any,
        *,
        cancel: str = '',
        patience: float = math.inf,
        least: float = 0.0,
    ) -> Any:
        """Return the response to `request` from the service called `name`.

        The call has failed after its time limit, which is at least `least` [s], or after `patience`
        [s] if that is shorter. The service called `cancel` then ends the requests with the token of
        this client, so that the model is free for the next one.

        Raises:
            ModelUnavailable: the service is absent, silent, foreign, or refuses the request.
        """
        timeout = min(max(self.timeout, least), patience)
        client = self._client(service_type, name)
        if not client.wait_for_service(timeout_sec=min(timeout, LONGEST_SEARCH_S)):
            raise ModelUnavailable(f"service '{name}' is absent; start the node that offers it")
        if cancel:
            request.token = self.token
        response = self._answered(client, name, request, timeout)
        if response is None:
            if cancel:
                own = Cancel.Request(token=self.token)
                self._answered(self._client(Cancel, cancel), cancel, own, CANCEL_WAIT_S)
            raise ModelUnavailable(f"service '{name}' did not answer within {timeout:g} s")
        outcome = getattr(response, 'outcome', None)
        if outcome is not None and outcome.code != Outcome.OK:
            raise ModelUnavailable(f"service '{name}' refuses: {outcome.message}")
        return response

    def _client(self, service_type: Any, name: str) -> Any:
        if name not in self._clients:
            self._clients[name] = self._node.create_client(service_type, name)
        return self._clients[name]

    def _answered(self, client: Any, name: str, request: Any, timeout: float) -> Any:
        """Return the response to a call, None after `timeout` [s].

        Raises:
            ModelUnavailable: another node offers the service, or it was started again.
        """
        if name in CALLERS:
            self._voucher.vouch(name, request)
        try:
            return twin_answer_within(self._node, client, request, timeout)
        except InputError as error:
            raise ModelUnavailable(str(error)) from None


class PhysicsModelClient:
    """The physics-based model behind `solver/...`; a `forecast.PhysicsModel`."""

    def __init__(self, call: Caller, grid: Grid) -> None:
        """Ask for maps on `grid`."""
        self._call = call
        self._grid = grid

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the prediction c~^(n+1) (nz, nx) after `time_step` [s].

        Raises:
            ModelUnavailable: the solver is absent, silent, or refuses the request.
        """
        request = Predict.Request(
            previous=conversions.tracer_to_msg(concentration, self._grid, 0.0),
            wells=conversions.rates_to_msg(rates),
            time_step=conversions.duration_to_msg(time_step),
        )
        response = self._call(Predict, 'solver/predict', request, cancel=CANCEL)
        return _map_of('solver/predict', response.predicted)

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return the corrected prediction c^(n+1) (nz, nx), with the source `sigma` [1/s].

        Raises:
            ModelUnavailable: the solver is absent, silent, or refuses the request.
        """
        request = Correct.Request(
            previous=conversions.tracer_to_msg(previous, self._grid, 0.0),
            source=conversions.source_to_msg(sigma, self._grid, 0.0),
            wells=conversions.rates_to_msg(rates),
            time_step=conversions.duration_to_msg(time_step),
        )
        response = self._call(Correct, 'solver/correct', request, cancel=CANCEL)
        return _map_of('solver/correct', response.corrected)


class PlanModelClient:
    """The costs of plans behind `solver/cost_gradient`; a `plan_controller.PlanModel`.

    With another `model`, `siblings`, they are the mean over its siblings.
    """

    def __init__(self, call: Caller, rig: Rig, model: str = 'solver') -> None:
        """Ask `model` for the plans of `rig`."""
        self._call = call
        self._rig = rig
        self._service = f'{model}/cost_gradient'
        self._cancel = CANCEL if model == 'solver' else ''

    def plan_cost(
        self,
        initial: FloatArray,
        plan: Sequence[RateStep],
        *,
        horizon: float,
        terms: Sequence[CostTerm],
        with_gradient: bool,
        learnt: LearntPhysics,
        patience: float,
    ) -> tuple[float, FloatArray | None]:
        """Return the cost of `plan` and, if asked for, its gradient (steps, wells).

        Raises:
            ModelUnavailable: the solver is absent, silent, or refuses the request.
        """
        nz, nx = initial.shape
        request = CostGradient.Request(
            initial=conversions.tracer_to_msg(initial, self._rig.grid(nx, nz), 0.0),
            schedule=conversions.plan_to_msg(plan),
            horizon=conversions.duration_to_msg(horizon),
            terms=[conversions.cost_term_to_msg(term) for term in terms],
            with_gradient=with_gradient,
            learnt=conversions.learnt_to_msg(learnt),
        )
        response = self._call(
            CostGradient,
            self._service,
            request,
            cancel=self._cancel,
            patience=max(patience, LEAST_PATIENCE_S),
        )
        if not (math.isfinite(response.cost) and np.isfinite(response.gradient).all()):
            raise ModelUnavailable(f"service '{self._service}' answers wrongly: not finite")
        if not with_gradient:
            return float(response.cost), None
        shape = (len(plan), len(self._rig.wells))
        if len(response.gradient) != math.prod(shape):
            raise ModelUnavailable(
                f"service '{self._service}' answers wrongly: {len(response.gradient)} "
                f'derivatives, not {shape[0]} x {shape[1]}'
            )
        return float(response.cost), np.array(response.gradient).reshape(shape)


class DataDrivenModelClient:
    """The data-driven model behind `costa/corrective_source`; a `correction.CorrectionFn`."""

    def __init__(self, call: Caller, grid: Grid) -> None:
        """Ask for maps on `grid`."""
        self._call = call
        self._grid = grid

    def __call__(
        self, predicted: FloatArray, rates: WellRates, time_step: float, previous: FloatArray
    ) -> Correction:
        """Return sigma (nz, nx) [1/s], or None with the reason, also if the service is absent."""
        request = CorrectiveSource.Request(
            predicted=conversions.tracer_to_msg(predicted, self._grid, 0.0),
            previous=conversions.tracer_to_msg(previous, self._grid, 0.0),
            wells=conversions.rates_to_msg(rates),
            time_step=conversions.duration_to_msg(time_step),
        )
        try:
            response = self._call(CorrectiveSource, 'costa/corrective_source', request)
            if not response.active:
                return Correction(None, response.status)
            sigma, _ = conversions.source_from_msg(response.source)
            learnt = LearntPhysics(conversions.effects_from_msg(response.learnt))
            return Correction(sigma, response.status, learnt)
        except (ModelUnavailable, InputError) as error:
            return Correction(None, str(error))


def _map_of(service: str, message: TracerField) -> FloatArray:
    """Return the map (nz, nx) [-] that `service` answered.

    Raises:
        ModelUnavailable: the answer is no map of concentrations, or has cells without one.
    """
    try:
        found = conversions.tracer_from_msg(message)[0]
    except InputError as error:
        raise ModelUnavailable(f"service '{service}' answers wrongly: {error}") from None
    if not np.isfinite(found).all():
        raise ModelUnavailable(f"service '{service}' answers wrongly: not finite")
    return found


def send_control(call: Caller, setpoint: Setpoint) -> None:
    """Ask the guard to publish `setpoint` and to hand it to the pumps.

    Raises:
        ModelUnavailable: guard or pumps are absent, silent, or refuse the setpoint.
    """
    request = Control.Request(setpoint=setpoint)
    call(Control, 'guard/control', request, least=GUARD_PATIENCE_S)
