"""The node that offers the physics-based model as services (paper sec. 2.3)."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.event_handler import QoSSubscriptionMatchedInfo
from rosgraph_msgs.msg import Clock

from porotwin_core import __version__
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import DAY_S
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rig import EffectDescription
from porotwin_core.ros import qos
from porotwin_core.ros.conversions import (
    cost_term_from_msg,
    effect_to_msg,
    effects_from_msg,
    grid_to_msg,
    header_at,
    nanoseconds_from_msg,
    ok,
    plan_from_msg,
    rates_from_msg,
    refusal,
    seconds_from_msg,
    source_from_msg,
    source_to_msg,
    time_from_msg,
    tracer_from_msg,
    tracer_to_msg,
)
from porotwin_core.ros.following import follow
from porotwin_core.ros.node import TwinNode, declare, declare_grid, declare_rig, run
from porotwin_core.ros.single_instance import only_one
from porotwin_core.ros.vouching import OnlyCaller
from porotwin_msgs.msg import (
    ModelEffects,
    Outcome,
    SourceField,
    StateRefreshed,
    TracerField,
)
from porotwin_msgs.srv import (
    Cancel,
    Correct,
    CostGradient,
    InitialCondition,
    ModelInfo,
    Ping,
    Predict,
    QuantityOfInterest,
    Residual,
    Rollout,
    SetEffects,
)
from porotwin_solver.adjoint.grid_models import GridModels, refuse_another_size
from porotwin_solver.coefficients.quantities import QUANTITIES
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import PRESETS
from porotwin_solver.model.rollout import rollout
from porotwin_solver.model.supervision import Supervision
from porotwin_solver.service.effects_in_force import checked_effects, in_words
from porotwin_solver.service.replayed_effects import ReplayedEffects
from porotwin_solver.service.turns import BusyError, CancelledError, Turns

SET_EFFECTS = 'solver/set_effects'

Handler = Callable[[Any, Any], None]

MOST_WAITING = 4
"""Requests that may wait while another one works: the graph has three clients."""

THREADS = MOST_WAITING + 5
"""One thread works, some wait, one answers `solver/cancel`, two `solver/set_effects`, and one
refuses a request too many."""

MOST_CELL_UPDATES = 2e8
"""Most cell updates of a prediction, unless a parameter changes it: about 20 s beside a busy
graph, as long as the hub waits; a prediction of ten minutes of the small rig needs 1e6."""


class SolverNode(TwinNode):
    """Offers `solver/predict`, `residual`, `correct` and more for one rig, grid and preset.

    `solver/cost_gradient` and `solver/rollout` also take states on a coarser grid.
    `solver/set_effects` lets effects act beyond those of rig.yaml; `model/effects` tells them.

    The parameters `rig`, `grid` and `preset` choose them. A request that fails gets its reason in
    `outcome`, and the log gets one line.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters, factorise the flow, offer the services.

        Raises:
            InputError: a parameter or the rig is wrong.
        """
        super().__init__('solver', **kwargs)
        rig = declare_rig(self)
        preset = declare(
            self, 'preset', 'fast', f'numerical preset: {", ".join(PRESETS)}', choices=PRESETS
        )
        grid = declare_grid(self, rig)
        self._turns = Turns(MOST_WAITING)
        coarse_preset = declare(
            self,
            'coarse_preset',
            'fast',
            'preset of plans on a coarser grid, which smears more; second order makes up for it',
            choices=PRESETS,
        )
        self._models = GridModels(
            rig,
            grid,
            preset=preset,
            coarse_preset=coarse_preset,
            supervision=self._declare_supervision(),
        )
        # a request that works must not keep these from being answered
        quick = MutuallyExclusiveCallbackGroup()
        self.create_service(Ping, 'solver/ping', self._ping, callback_group=quick)
        self.create_service(ModelInfo, 'solver/info', self._info, callback_group=quick)
        self.create_service(Cancel, 'solver/cancel', self._cancel, callback_group=quick)
        self._group = ReentrantCallbackGroup()
        self._serve(InitialCondition, 'solver/initial_condition', self._initial_condition)
        self._serve(Predict, 'solver/predict', self._predict)
        self._serve(Residual, 'solver/residual', self._residual)
        self._serve(Correct, 'solver/correct', self._correct)
        self._serve(CostGradient, 'solver/cost_gradient', self._cost_gradient)
        self._serve(Rollout, 'solver/rollout', self._rollout)
        self._offer_effects()
        self._serve(QuantityOfInterest, 'solver/quantity_of_interest', self._quantity)
        self.get_logger().info(f'{rig.name}: {grid} cells, preset {preset}, ready')

    @property
    def model(self) -> Model:
        """The model on the grid of the maps."""
        return self._models.own

    def _declare_supervision(self) -> Supervision:
        return Supervision(
            longest_s=declare(
                self,
                'longest_prediction_s',
                DAY_S,
                'longest time that a prediction may cover [s]',
                at_least=1.0,
                at_most=365 * DAY_S,
            ),
            most_cell_updates=declare(
                self,
                'most_cell_updates',
                MOST_CELL_UPDATES,
                'most cell updates of a prediction; a core does about 1e7 per second',
                at_least=1e4,
                at_most=1e12,
            ),
            check=self._turns.check,
        )

    def _offer_effects(self) -> None:
        """Tell the effects in force, and take others.

        In simulated time the effects may come from a recording that is replayed: they are followed
        as they were decided. Every replay begins with the model as described, and so does every
        repetition of one.
        """
        self._replay = ReplayedEffects() if self.simulated else None
        self._in_force = ModelEffects(header=header_at(0.0), reason='the start of the solver')
        self._newest_photograph = 0.0
        self._told = self.create_publisher(ModelEffects, 'model/effects', qos.CONFIG)
        self._publish_effects()
        own = MutuallyExclusiveCallbackGroup()
        self._mend = OnlyCaller(self, SET_EFFECTS)
        self.create_service(SetEffects, 'solver/set_effects', self._set_effects, callback_group=own)
        follow(self, StateRefreshed, 'asset/state_refreshed', self._on_refreshed, qos.FIELD)
        follow(
            self, ModelEffects, 'model/effects', self._on_effects, qos.DECISIONS, callback_group=own
        )
        if self._replay is not None:
            follow(
                self,
                Clock,
                '/clock',
                self._on_clock,
                qos.CLOCK,
                callback_group=own,
                on_writer=self._on_player,
            )

    def _serve(self, kind: Any, name: str, handler: Handler) -> None:
        def answer(request: Any, response: Any) -> Any:
            try:
                token = getattr(request, 'token', '')
                with self._turns.turn(lambda: self.count_clients(name) == 0, token=token):
                    handler(request, response)
                response.outcome = ok()
            except CancelledError as error:
                response.outcome = refusal(error)
                self.get_logger().info(f'{name}: {error}')
            except BusyError as error:
                response.outcome = Outcome(code=Outcome.NOT_READY, message=str(error))
                self.get_logger().warning(f'{name}: {error}')
            except Exception as error:
                response.outcome = refusal(error)
                self.get_logger().error(f'{name}: {response.outcome.message}')
            return response

        self.create_service(kind, name, answer, callback_group=self._group)

    def _cancel(self, request: Cancel.Request, response: Cancel.Response) -> Cancel.Response:
        response.cancelled = self._turns.cancel(request.token)
        return response

    def _on_refreshed(self, message: StateRefreshed) -> None:
        self._newest_photograph = time_from_msg(message.header.stamp)

    def _set_effects(
        self, request: SetEffects.Request, response: SetEffects.Response
    ) -> SetEffects.Response:
        try:
            caller = self._mend.check(request)
            effects = checked_effects(self.model.rig, effects_from_msg(request.effects))
            self._change_effects(effects)
        except BusyError as error:
            response.outcome = Outcome(code=Outcome.NOT_READY, message=str(error))
        except Exception as error:
            response.outcome = refusal(error)
        else:
            response.outcome = ok()
            self._tell(
                ModelEffects(
                    header=header_at(self._newest_photograph),
                    sequence=self._in_force.sequence + 1,
                    effects=[effect_to_msg(effect) for effect in effects],
                    reason=f'{caller.node.rpartition("/")[2]} set: {in_words(effects)}',
                )
            )
        if response.outcome.code != Outcome.OK:
            self.get_logger().error(f'{SET_EFFECTS}: {response.outcome.message}')
        response.in_force = self._in_force
        return response

    def _on_effects(self, message: ModelEffects, info: Mapping[str, int]) -> None:
        """Follow effects that a replay publishes, if they are others than those in force."""
        if self._replay is None or self._replay.is_own(str(message)):
            return
        try:
            effects = effects_from_msg(message.effects)
            if effects != effects_from_msg(self._in_force.effects):
                self._change_effects(checked_effects(self.model.rig, effects))
                message.sequence = self._in_force.sequence + 1
                self._tell(message)
        except Exception as error:
            self.get_logger().error(f'model/effects not followed: {refusal(error).message}')
            return
        self._replay.decide(info['source_timestamp'])

    def _on_clock(self, message: Clock, info: Mapping[str, int]) -> None:
        """Return to the model as described where the replay starts again."""
        assert self._replay is not None
        now = nanoseconds_from_msg(message.clock)
        if self._replay.begins_anew(now, info['source_timestamp']):
            self._begin_replay('the replay goes back in time')

    def _on_player(self, matched: QoSSubscriptionMatchedInfo) -> None:
        """Return to the model as described for another source of time than the first one."""
        assert self._replay is not None
        if 0 < matched.total_count_change < matched.total_count:
            self._replay.forget()
            self._begin_replay('another replay begins')

    def _begin_replay(self, reason: str) -> None:
        if not self._in_force.effects:
            return
        try:
            self._change_effects(())
        except Exception as error:
            self.get_logger().error(f'effects not removed: {refusal(error).message}')
            return
        sequence = self._in_force.sequence + 1
        self._tell(
            ModelEffects(
                header=header_at(0.0), sequence=sequence, reason=f'{reason}: {in_words(())}'
            )
        )

    def _change_effects(self, effects: tuple[EffectDescription, ...]) -> None:
        """Let `effects` act from the next request on.

        Raises:
            InputError: the model cannot be solved with them.
            BusyError: too many requests wait.
        """
        with self._turns.turn():
            self._models = self._models.with_effects(effects)

    def _tell(self, in_force: ModelEffects) -> None:
        self._in_force = in_force
        self._publish_effects()
        self.get_logger().info(f'effects {in_force.sequence}: {in_force.reason}')

    def _publish_effects(self) -> None:
        if self._replay is not None:
            self._replay.tell(str(self._in_force))
            self._replay.decide(time.time_ns())
        self._told.publish(self._in_force)

    def _ping(self, _: Ping.Request, response: Ping.Response) -> Ping.Response:
        response.name = self.get_name()
        response.version = __version__
        response.status = f'{self.model.grid} cells, preset {self.model.preset}'
        response.time = self.get_clock().now().to_msg()
        return response

    def _info(self, _: ModelInfo.Request, response: ModelInfo.Response) -> ModelInfo.Response:
        model = self.model
        response.degrees_of_freedom = model.grid.nx * model.grid.nz
        response.grid = grid_to_msg(model.grid)
        response.preset = model.preset
        response.wells = list(model.rig.wells)
        response.quantities_of_interest = list(QUANTITIES)
        response.effects = [effect_to_msg(effect) for effect in model.effects]
        response.version = __version__
        return response

    def _initial_condition(self, _: Any, response: Any) -> None:
        initial = self.model.initial_condition()
        response.state = tracer_to_msg(initial, self.model.grid, self.now())

    def _predict(self, request: Any, response: Any) -> None:
        predicted = self.model.predict(
            self._map(request.previous),
            rates_from_msg(request.wells),
            seconds_from_msg(request.time_step),
        )
        response.predicted = tracer_to_msg(predicted, self.model.grid, _end_time(request))

    def _residual(self, request: Any, response: Any) -> None:
        residual = self.model.residual(
            self._map(request.previous),
            self._map(request.next),
            rates_from_msg(request.wells),
            seconds_from_msg(request.time_step),
        )
        response.residual = source_to_msg(residual, self.model.grid, _end_time(request))

    def _correct(self, request: Any, response: Any) -> None:
        corrected = self.model.correct(
            self._map(request.previous),
            self._source(request.source),
            rates_from_msg(request.wells),
            seconds_from_msg(request.time_step),
        )
        response.corrected = tracer_to_msg(corrected, self.model.grid, _end_time(request))

    def _cost_gradient(self, request: Any, response: Any) -> None:
        initial, grid = tracer_from_msg(request.initial)
        refuse_another_size(grid, self.model.grid, 'state')
        response.cost, by_rate = self._models.plan_cost(
            initial,
            plan_from_msg(request.schedule),
            horizon=seconds_from_msg(request.horizon),
            terms=[cost_term_from_msg(term, grid) for term in request.terms],
            with_gradient=request.with_gradient,
            learnt=LearntPhysics(effects_from_msg(request.learnt)),
        )
        if by_rate is not None:
            response.gradient = np.ravel(by_rate).tolist()

    def _rollout(self, request: Any, response: Any) -> None:
        initial, grid = tracer_from_msg(request.initial)
        model = self._models.on(grid)
        begin = time_from_msg(request.initial.header.stamp)
        times = [seconds_from_msg(time) for time in request.times]
        maps = rollout(model, initial, plan_from_msg(request.schedule), times)
        response.states = [
            tracer_to_msg(values, model.grid, begin + time)
            for time, values in zip(times, maps, strict=True)
        ]

    def _quantity(self, request: Any, response: Any) -> None:
        state = self._map(request.state)
        response.value = self.model.quantity_of_interest(request.name, state)
        response.unit = QUANTITIES[request.name][0]

    def _map(self, message: TracerField) -> FloatArray:
        values, grid = tracer_from_msg(message)
        return self._on_grid(values, grid, 'tracer field')

    def _source(self, message: SourceField) -> FloatArray:
        values, grid = source_from_msg(message)
        return self._on_grid(values, grid, 'source field')

    def _on_grid(self, values: FloatArray, grid: Grid, kind: str) -> FloatArray:
        if grid.shape != self.model.grid.shape:
            raise InputError(
                f'{kind} on {grid} cells: the solver runs on {self.model.grid}; '
                'resample it or set the parameter grid'
            )
        refuse_another_size(grid, self.model.grid, kind)
        return values


def _end_time(request: Any) -> float:
    return time_from_msg(request.previous.header.stamp) + seconds_from_msg(request.time_step)


def main() -> None:
    """Run the node until it is interrupted, unless another solver is there."""
    run(only_one(SolverNode, 'solver'), threads=THREADS)


if __name__ == '__main__':
    main()
