"""The data-driven model as a node: corrective source terms as a service, training as an action.

Training runs in the thread of its action while other threads answer requests. A request uses
either the model before the training or the one after it. Without a model the node never loads the
library torch, which takes longer than everything else of a start.
"""

import math
import time
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import MOST_WORKERS
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.correction import Correction
from porotwin_core.model.learnt_solver import LearntSolver, solver_named
from porotwin_core.rates.wells import WellRates
from porotwin_core.ros import conversions
from porotwin_core.ros.from_messages import path_from_msg
from porotwin_core.ros.model_effects import ToldEffects, follow_effects
from porotwin_core.ros.node import Diagnostics, TwinNode, declare, declare_grid, declare_rig, run
from porotwin_core.ros.senders import cancels_of, goals_of
from porotwin_core.ros.single_instance import only_one
from porotwin_core.ros.vouching import OnlyCaller
from porotwin_costa.correction.corrective_source import WITHHELD, LearntStep, corrective_source
from porotwin_costa.data.dataset import (
    Dataset,
    join_datasets,
    load_dataset,
    newest_pairs,
    pairs_beside,
)
from porotwin_costa.data.physics_id import PhysicsId, untaught
from porotwin_msgs.action import Train
from porotwin_msgs.msg import Outcome, TracerField
from porotwin_msgs.srv import CorrectiveSource, DataModelInfo, LoadModel, Ping, SaveModel

if TYPE_CHECKING:
    from porotwin_costa.correction.corrective_model import CorrectiveModel
    from porotwin_costa.networks import Architecture
    from porotwin_costa.training.live_training import LiveTraining
    from porotwin_costa.training.training import TrainingProgress

TRAIN = 'costa/train'
"""Action that trains a model."""

DEFAULT_PRESET = 'fast'
"""Scheme of the solver that judges a training, where the node was told none."""

FEEDBACK_S = 10.0
"""Time between two reports of a training [s]."""

MOST_PAIRS = 3000
"""Newest pairs that a training reads from the folder of a trainer: a day of photographs every 30 s,
about 1 GB for maps of 5 mm on the small rig."""


def _version() -> str:
    try:
        return version('porotwin_costa')
    except PackageNotFoundError:
        return 'source tree'


@dataclass(frozen=True)
class _InUse:
    """The model in use, the solver with its learnt physics, and its file: replaced as a whole."""

    model: 'CorrectiveModel | None' = None
    physics: LearntStep | None = None
    path: str = ''


class CostaNode(TwinNode):
    """Device that answers with sigma; zero until a model is loaded or trained."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters, load a model if there is one, and offer the services.

        Raises:
            InputError: a parameter, the rig or the named model is wrong.
        """
        super().__init__('costa', **kwargs)
        rig = declare_rig(self)
        self._grid = declare_grid(self, rig)
        self._rig = self._present_rig = rig
        self._preset = declare(
            self, 'preset', '', 'numerical scheme of the solver; empty: not checked'
        )
        self._architecture = declare(
            self,
            'architecture',
            '',
            'network to train if a goal names none; empty: the one of the loaded model',
        )
        if self._architecture:
            _named(self._architecture)
        self._threads = declare(
            self,
            'threads',
            1,
            'threads that the network may use',
            at_least=1,
            at_most=MOST_WORKERS,
        )
        self._solver = declare(
            self,
            'solver',
            'porotwin_solver.adjoint.learnt_coefficients:LearntModels',
            'class that runs learnt physics, as package.module:Class',
        )
        self._one_at_a_time = Lock()
        self._choosing = Lock()
        """Held by the thread that decides on the model in use."""
        self._in_use = _InUse()
        self._training = False
        self._feedback: tuple[ServerGoalHandle, Train.Feedback] | None = None
        model = declare(self, 'model', '', 'model to load; empty: none')
        self._named_model = model
        """The model that a person named last: beside it lie the pairs that every training takes."""
        self._loads = 0
        """Models that were loaded by a request: none of them gives way to an older training."""
        trained = declare(
            self, 'trained_model', '', 'weights of an earlier training; used instead, once there'
        )
        if trained and Path(trained).is_file():
            # it may correct the model with effects that are not told yet
            self._keep(self._loaded(trained), trained)
        elif model:
            self._use(self._loaded(model), model)
        self._diagnostics = Diagnostics(self)
        self._offer()
        self._tell()

    def _offer(self) -> None:
        group = ReentrantCallbackGroup()
        # a forged request is waited for, and a forecast must not wait for it
        apart = MutuallyExclusiveCallbackGroup()
        for service, name, answer, among in (
            (Ping, 'ping', self._ping, group),
            (DataModelInfo, 'info', self._info, group),
            (CorrectiveSource, 'corrective_source', self._corrective_source, group),
            (LoadModel, 'load', self._load, apart),
            (SaveModel, 'save', self._save, apart),
        ):
            self.create_service(service, f'costa/{name}', answer, callback_group=among)
        called = ('costa/load', 'costa/save', goals_of(TRAIN), cancels_of(TRAIN))
        self._callers = {name: OnlyCaller(self, name) for name in called}
        follow_effects(self, self._on_effects)
        self._action = ActionServer(
            self,
            Train,
            TRAIN,
            self._train,
            goal_callback=self._on_goal,
            cancel_callback=self._callers[cancels_of(TRAIN)].cancels,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # also while simulated time stands still
        self.create_timer(FEEDBACK_S, self._report_training, callback_group=group, clock=steady)

    def _on_effects(self, told: ToldEffects) -> None:
        """Follow the effects of the solver; a model that corrects other physics is withheld."""
        with self._choosing:
            self._present_rig = self._rig.with_effects(told.effects)
            if objection := self._objection():
                self.get_logger().warning(f'no corrections: {objection}')
            elif (kept := self._in_use).model is not None:
                self._keep(kept.model, kept.path)

    def _objection(self) -> str:
        """Return why the model does not correct the physics in force, or an empty string."""
        model = self._in_use.model
        if model is not None and (unknown := untaught(self._rig)):
            return unknown
        present = PhysicsId.of(self._present_rig, self._preset)
        if model is None or not model.physics.difference(present):
            return ''
        return 'the effects of the solver have changed; COSTA must learn the remainder first'

    def _loaded(self, path: str | Path) -> 'CorrectiveModel':
        from porotwin_costa.correction.corrective_model import CorrectiveModel

        self._limit_threads()
        return CorrectiveModel.load(Path(path))

    def _limit_threads(self) -> None:
        import torch

        torch.set_num_threads(self._threads)

    def _tell(self) -> None:
        """Say in the log and on the page which model is used, and what its gate decided."""
        self.get_logger().info(self._status())
        self._diagnostics.report(DiagnosticStatus.OK, self._status())

    def _use(self, model: 'CorrectiveModel', path: str) -> None:
        """Use a model that corrects the physics in force.

        Raises:
            InputError: it corrects another one.
        """
        self._keep(model.for_physics(self._present_rig, self._grid, self._preset), path)

    def _keep(self, model: 'CorrectiveModel', path: str) -> None:
        """Keep a model; it is withheld while other physics are in force.

        Raises:
            InputError: it is on another grid, or for other wells.
        """
        checked = model.for_wells(tuple(self._rig.wells), self._grid)
        physics = None if model.learnt is None else LearntStep(model.learnt, self._make_solver())
        with self._one_at_a_time:
            self._in_use = _InUse(checked, physics, path)
        if model.doubt:
            self.get_logger().warning(model.doubt)

    def _status(self) -> str:
        model = self._in_use.model
        return model.summary if model else 'no model loaded'

    def _ping(self, _: Ping.Request, response: Ping.Response) -> Ping.Response:
        response.name, response.version, response.status = 'costa', _version(), self._status()
        response.time = self.get_clock().now().to_msg()
        return response

    def _info(
        self, _: DataModelInfo.Request, response: DataModelInfo.Response
    ) -> DataModelInfo.Response:
        in_use = self._in_use
        model = in_use.model
        response.loaded = model is not None
        response.version = _version()
        response.grid = conversions.grid_to_msg(self._grid)
        response.wells = list(self._rig.wells)
        if model is not None:
            response.path = in_use.path
            response.architecture = model.architecture.name
            response.time_step = conversions.duration_to_msg(model.time_step)
            response.provenance = model.summary
        return response

    def _corrective_source(
        self, request: CorrectiveSource.Request, response: CorrectiveSource.Response
    ) -> CorrectiveSource.Response:
        try:
            predicted, grid = conversions.tracer_from_msg(request.predicted)
            rates = conversions.rates_from_msg(request.wells)
            time_step = conversions.seconds_from_msg(request.time_step)
            self._refuse_impossible(rates, time_step)
            answer = self._answer(predicted, rates, time_step, _known_map(request.previous))
        except InputError as error:
            response.outcome = conversions.refusal(error)
            response.status = str(error)
            return response
        response.outcome = conversions.ok()
        sigma = np.zeros(grid.shape) if answer.sigma is None else answer.sigma
        response.source = conversions.source_to_msg(sigma, grid, 0.0)
        response.source.header = request.predicted.header
        response.active = answer.applied
        response.learnt = conversions.learnt_to_msg(answer.learnt)
        response.status = answer.status
        return response

    def _answer(
        self,
        predicted: FloatArray,
        rates: WellRates,
        time_step: float,
        previous: FloatArray | None,
    ) -> Correction:
        """Return sigma, or why there is none; the learnt physics serves one request at a time."""
        with self._one_at_a_time:
            if reason := self._objection():
                return Correction(None, f'{WITHHELD}{reason}')
            model, physics = self._in_use.model, self._in_use.physics
            return corrective_source(model, predicted, rates, time_step, previous, physics=physics)

    def _make_solver(self) -> LearntSolver:
        preset = self._preset or DEFAULT_PRESET
        return solver_named(self._solver)(self._present_rig, self._grid, preset)

    def _refuse_impossible(self, rates: WellRates, time_step: float) -> None:
        if not (math.isfinite(time_step) and time_step > 0.0):
            raise InputError(f'time step {time_step} s: must be positive')
        unknown = sorted(set(rates) - set(self._rig.wells) - set(self._rig.levels))
        if unknown:
            known = ', '.join(self._rig.wells)
            raise InputError(f"well '{unknown[0]}' is not in rig.yaml; known: {known}")

    def _load(self, request: LoadModel.Request, response: LoadModel.Response) -> LoadModel.Response:
        try:
            self._callers['costa/load'].check(request)
            loaded = self._loaded(path_from_msg(request.path))
            with self._choosing:
                self._use(loaded, request.path)
                self._named_model = request.path
                self._loads += 1
        except InputError as error:
            response.outcome = conversions.refusal(error)
            self.get_logger().error(f'model not loaded: {error}')
            return response
        response.outcome = conversions.ok()
        self.get_logger().info(f'loaded {request.path}')
        self._tell()
        return response

    def _save(self, request: SaveModel.Request, response: SaveModel.Response) -> SaveModel.Response:
        in_use = self._in_use
        try:
            self._callers['costa/save'].check(request)
            if in_use.model is None:
                response.outcome = Outcome(
                    code=Outcome.NOT_READY, message='no model loaded; train or load one first'
                )
                return response
            in_use.model.save(path_from_msg(request.path))
        except InputError as error:
            response.outcome = conversions.refusal(error)
            self.get_logger().error(f'model not saved: {error}')
            return response
        with self._choosing:
            if self._in_use is in_use:
                self._in_use = replace(in_use, path=request.path)
        response.outcome = conversions.ok()
        return response

    def _on_goal(self, goal: Train.Goal) -> GoalResponse:
        try:
            self._callers[goals_of(TRAIN)].check(goal)
            if self._training:
                raise InputError('another one is running; wait for it or cancel it')
        except InputError as error:
            self.get_logger().warning(f'training refused: {error}')
            return GoalResponse.REJECT
        self._training = True
        return GoalResponse.ACCEPT

    def _train(self, handle: ServerGoalHandle) -> Train.Result:
        result = Train.Result()
        self._feedback = handle, Train.Feedback()
        try:
            model = self._trained(handle)
        except Exception as error:
            # a failed training must not end the node: it keeps the model that it has
            if handle.is_cancel_requested:
                handle.canceled()
                result.outcome = Outcome(code=Outcome.FAILED, message=f'cancelled: {error}')
            else:
                handle.abort()
                result.outcome = conversions.refusal(error)
                self.get_logger().error(f'training failed: {result.outcome.message}')
                self._diagnostics.report(DiagnosticStatus.ERROR, result.outcome.message)
        else:
            handle.succeed()
            result.outcome = conversions.ok()
            result.path = handle.request.output
            result.samples = model.provenance['samples']
            result.epochs = model.provenance['epochs']
            result.training_loss = model.provenance['training_loss']
            result.validation_loss = model.provenance['validation_loss']
            self._diagnostics.report(DiagnosticStatus.OK, self._status())
        finally:
            self._training, self._feedback = False, None
        return result

    def _report_training(self) -> None:
        """Repeat the last feedback: pairs are simulated for minutes before the first epoch."""
        feedback = self._feedback
        if feedback is not None:
            handle, message = feedback
            handle.publish_feedback(message)

    def _trained(self, handle: ServerGoalHandle) -> 'CorrectiveModel':
        from porotwin_costa.correction.corrective_model import check_replaceable
        from porotwin_costa.training.live_training import not_used

        self._limit_threads()
        goal = handle.request
        begun = time.perf_counter()
        if goal.output:
            check_replaceable(path_from_msg(goal.output))
        dataset = _training_pairs(path_from_msg(goal.dataset))
        chosen = self._chosen_architecture(goal.architecture)
        self.get_logger().info(f'training the {chosen.name} network on {dataset.summary}')

        def report(progress: 'TrainingProgress') -> None:
            message = Train.Feedback(
                epoch=progress.epoch,
                epochs=progress.epochs,
                training_loss=progress.training_loss,
                validation_loss=progress.validation_loss,
                remaining=conversions.duration_to_msg(progress.remaining_seconds),
            )
            self._feedback = handle, message
            handle.publish_feedback(message)

        judged, loads = self._in_use.model, self._loads
        model, is_better = self._live_training().retrained(
            self._with_offline_pairs(dataset),
            None if self._objection() else judged,
            chosen,
            epochs=goal.epochs,
            seed=goal.seed,
            progress=report,
            cancelled=lambda: handle.is_cancel_requested,
        )
        model.for_physics(self._present_rig, self._grid, self._preset)
        with self._choosing:
            verdict = 'in use' if is_better else 'not better on the newest pairs, the old one stays'
            if self._loads != loads:
                is_better, verdict = False, 'another model was loaded meanwhile, which stays'
            if goal.output:
                output = path_from_msg(goal.output)
                model.save(output if is_better else not_used(output))
            if is_better:
                self._use(model, goal.output)
        seconds = time.perf_counter() - begun
        self.get_logger().info(f'trained in {seconds:.1f} s, {verdict}: {model.summary}')
        return model

    def _live_training(self) -> 'LiveTraining':
        from porotwin_costa.training.live_training import LiveTraining

        return LiveTraining(self._present_rig, self._preset or DEFAULT_PRESET, self._make_solver())

    def _with_offline_pairs(self, live: Dataset) -> Dataset:
        """Return the pairs that the named model was trained on, if it has some, and the new ones.

        The new ones come last, so that the newest part is kept to judge. A training does not change
        the first ones, nor does a restart with its weights: the next training needs them again.
        """
        offline = pairs_beside(Path(self._named_model)) if self._named_model else None
        if offline is None or not offline.is_file():
            return live
        try:
            return join_datasets([load_dataset(offline), live])
        except InputError as error:
            self.get_logger().warning(f'{offline}: left out ({error})')
            return live

    def _chosen_architecture(self, name: str) -> 'Architecture':
        """Return the architecture of the goal, the parameter, the loaded model, or the default."""
        name = name or self._architecture
        model = self._in_use.model
        if not name and model is not None:
            return model.architecture
        return _named(name)


def _named(name: str) -> 'Architecture':
    from porotwin_costa.networks import architecture

    return architecture(name)


def _training_pairs(path: Path) -> Dataset:
    """Return the pairs to train on: of a trainer's folder the newest, so that memory is bounded.

    Raises:
        InputError: the data set is missing, damaged or of another format.
    """
    return newest_pairs(path, MOST_PAIRS) if path.is_dir() else load_dataset(path)


def _known_map(message: TracerField) -> FloatArray | None:
    """Return the map (nz, nx) in a message, or None if it has no values."""
    return conversions.tracer_from_msg(message)[0] if len(message.concentration) else None


def main() -> None:
    """Run the node, unless another one is there; one thread trains while others answer."""
    run(only_one(CostaNode, 'costa'))


if __name__ == '__main__':
    main()
