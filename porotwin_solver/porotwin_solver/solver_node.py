"""The physics-based model as a device: answers ping, info, initial condition, predict and so on.

Every request is answered: what cannot be done comes back as an outcome with one line, and is logged
as one line.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.node import Node

from porotwin_core import __version__, conversions
from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.node import declare, run
from porotwin_core.rig import load_rig
from porotwin_msgs.msg import SourceField, TracerField
from porotwin_msgs.srv import (
    Correct,
    InitialCondition,
    ModelInfo,
    Ping,
    Predict,
    QuantityOfInterest,
    Residual,
)
from porotwin_solver.model import Model
from porotwin_solver.quantities import QUANTITIES


AnswerFn = Callable[[Any, Any], None]
"""Fills a response from a request; raises when it cannot."""


class SolverNode(Node):
    """Offers a `Model` under `solver/...`."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and prepare the model, compiled and warm.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('solver', **kwargs)
        rig = load_rig(declare(self, 'rig', '', 'path of rig.yaml'))
        text = declare(self, 'grid', str(rig.default_grid()), 'columns x rows of the maps')
        self._setting = declare(self, 'setting', 'fast', 'scheme: fast, accurate or upwind')
        self._grid = Grid.parse(text, rig.width_m, rig.height_m)
        self._model = Model(rig, self._grid, setting=self._setting)
        self._model.predict(self._model.initial_condition(), {}, 1.0)
        for service_type, name, answer in (
            (Ping, 'ping', self._ping),
            (ModelInfo, 'info', self._info),
            (InitialCondition, 'initial_condition', self._initial_condition),
            (Predict, 'predict', self._predict),
            (Residual, 'residual', self._residual),
            (Correct, 'correct', self._correct),
            (QuantityOfInterest, 'quantity_of_interest', self._quantity),
        ):
            self.create_service(service_type, f'solver/{name}', self._answering(name, answer))
        self.get_logger().info(f'{self._setting} model of {rig.name} on {self._grid} is ready')

    def _answering(
        self, name: str, answer: Callable[[Any, Any], None]
    ) -> Callable[[Any, Any], Any]:
        """Return the callback that fills a response, whatever happens."""

        def callback(request: Any, response: Any) -> Any:
            try:
                answer(request, response)
                if hasattr(response, 'outcome'):
                    response.outcome = conversions.ok()
            except Exception as error:
                # a request must not take the model away from everybody else
                response.outcome = conversions.refusal(error)
                self.get_logger().error(f'{name} refused: {response.outcome.message}')
            return response

        return callback

    def _ping(self, request: Ping.Request, response: Ping.Response) -> None:
        response.name = 'solver'
        response.version = __version__
        response.status = f'{self._setting} on {self._grid}'
        response.time = self.get_clock().now().to_msg()

    def _info(self, request: ModelInfo.Request, response: ModelInfo.Response) -> None:
        rig = self._model.rig
        response.degrees_of_freedom = self._grid.nx * self._grid.nz
        response.grid = conversions.grid_to_msg(self._grid)
        response.setting = self._setting
        response.wells = list(rig.wells)
        response.quantities_of_interest = list(QUANTITIES)
        response.effects = conversions.rig_to_msg(rig).effects
        response.version = __version__

    def _initial_condition(
        self, request: InitialCondition.Request, response: InitialCondition.Response
    ) -> None:
        response.state = self._map_message(self._model.initial_condition(), 0.0)

    def _predict(self, request: Predict.Request, response: Predict.Response) -> None:
        predicted = self._model.predict(
            self._map(request.previous, 'previous'),
            conversions.rates_from_msg(request.wells),
            request.time_step,
        )
        response.predicted = self._map_message(predicted, _end(request))

    def _residual(self, request: Residual.Request, response: Residual.Response) -> None:
        residual = self._model.residual(
            self._map(request.previous, 'previous'),
            self._map(request.next, 'next'),
            conversions.rates_from_msg(request.wells),
            request.time_step,
        )
        response.residual = conversions.source_to_msg(residual, self._grid, _end(request))

    def _correct(self, request: Correct.Request, response: Correct.Response) -> None:
        corrected = self._model.correct(
            self._map(request.previous, 'previous'),
            self._source(request.source),
            conversions.rates_from_msg(request.wells),
            request.time_step,
        )
        response.corrected = self._map_message(corrected, _end(request))

    def _quantity(
        self, request: QuantityOfInterest.Request, response: QuantityOfInterest.Response
    ) -> None:
        state = self._map(request.state, 'state')
        response.value = self._model.quantity_of_interest(request.name, state)
        response.unit = QUANTITIES[request.name][0]

    def _map(self, message: TracerField, name: str) -> FloatArray:
        return self._on_our_grid(*conversions.tracer_from_msg(message), name)

    def _source(self, message: SourceField) -> FloatArray:
        return self._on_our_grid(*conversions.source_from_msg(message), 'source')

    def _on_our_grid(self, values: FloatArray, grid: Grid, name: str) -> FloatArray:
        if grid != self._grid:
            raise InputError(f'{name} is on {grid}, the model on {self._grid}; start both alike')
        return values

    def _map_message(self, concentration: FloatArray, seconds: float) -> TracerField:
        return conversions.tracer_to_msg(np.asarray(concentration), self._grid, seconds)


def _end(request: Any) -> float:
    """Return the time that an answer is valid at [s]: the end of the request's time step."""
    return conversions.time_from_msg(request.previous.header.stamp) + request.time_step


def main() -> None:
    """Run the node."""
    run(SolverNode)


if __name__ == '__main__':
    main()
