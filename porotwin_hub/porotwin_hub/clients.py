"""The models of the graph as plain callables: service clients that wait, and say who is absent.

They block the calling thread until the answer is there, so they are for worker threads; the
executor must spin in another one. A blocking call in a callback would deadlock.
"""

import threading
from typing import Any

from rclpy.node import Node

from porotwin_core import conversions
from porotwin_core.correction import Correction
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.wells import WellRates
from porotwin_hub.twin import ModelUnavailable
from porotwin_msgs.msg import Outcome, Setpoint
from porotwin_msgs.srv import Control, Correct, CorrectiveSource, Predict


class Caller:
    """Calls services by name from a worker thread, each call with a time limit."""

    def __init__(self, node: Node, *, timeout: float) -> None:
        """Use `node` for clients; a call that takes longer than `timeout` [s] has failed."""
        self._node = node
        self._timeout = timeout
        self._clients: dict[str, Any] = {}

    def __call__(self, service_type: Any, name: str, request: Any) -> Any:
        """Return the response.

        Raises:
            ModelUnavailable: the service is absent, silent, or refuses the request.
        """
        if name not in self._clients:
            self._clients[name] = self._node.create_client(service_type, name)
        client = self._clients[name]
        if not client.wait_for_service(timeout_sec=min(self._timeout, 2.0)):
            raise ModelUnavailable(f"service '{name}' is absent; start the node that offers it")
        answered = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        if not answered.wait(self._timeout):
            client.remove_pending_request(future)
            raise ModelUnavailable(f"service '{name}' did not answer within {self._timeout:g} s")
        response = future.result()
        outcome = getattr(response, 'outcome', None)
        if outcome is not None and outcome.code != Outcome.OK:
            raise ModelUnavailable(f"service '{name}' refuses: {outcome.message}")
        return response


class PhysicsModelClient:
    """The physics-based model behind `solver/...`, with the signature of a local one."""

    def __init__(self, call: Caller, grid: Grid) -> None:
        self._call = call
        self._grid = grid

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return c~^(n+1) (nz, nx) after `time_step` [s]."""
        request = Predict.Request(
            previous=conversions.tracer_to_msg(concentration, self._grid, 0.0),
            wells=conversions.rates_to_msg(rates),
            time_step=float(time_step),
        )
        response = self._call(Predict, 'solver/predict', request)
        return conversions.tracer_from_msg(response.predicted)[0]

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return c^(n+1) with the source `sigma` (nz, nx) [1/s] added."""
        request = Correct.Request(
            previous=conversions.tracer_to_msg(previous, self._grid, 0.0),
            source=conversions.source_to_msg(sigma, self._grid, 0.0),
            wells=conversions.rates_to_msg(rates),
            time_step=float(time_step),
        )
        response = self._call(Correct, 'solver/correct', request)
        return conversions.tracer_from_msg(response.corrected)[0]


class DataDrivenModelClient:
    """The data-driven model behind `costa/corrective_source`; its absence is an answer."""

    def __init__(self, call: Caller, grid: Grid) -> None:
        self._call = call
        self._grid = grid

    def __call__(self, predicted: FloatArray, rates: WellRates, time_step: float) -> Correction:
        """Return sigma, or None with the reason."""
        request = CorrectiveSource.Request(
            predicted=conversions.tracer_to_msg(predicted, self._grid, 0.0),
            wells=conversions.rates_to_msg(rates),
            time_step=float(time_step),
        )
        try:
            response = self._call(CorrectiveSource, 'costa/corrective_source', request)
        except ModelUnavailable as error:
            return Correction(None, str(error))
        if not response.active:
            return Correction(None, response.status)
        return Correction(conversions.source_from_msg(response.source)[0], response.status)


def send_control(call: Caller, setpoint: Setpoint) -> None:
    """Ask the physical asset to pump `setpoint`.

    Raises:
        ModelUnavailable: the asset is absent, silent, or refuses the setpoint.
    """
    call(Control, 'asset/control', Control.Request(setpoint=setpoint))
