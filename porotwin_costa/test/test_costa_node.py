"""COSTA and its trainer as real processes; this test plays asset, solver and hub over DDS."""

import dataclasses
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from porotwin_core.errors import InputError
from porotwin_core.rig import write_rig
from porotwin_costa.dataset import build_dataset, load_dataset, mean_rates
from porotwin_costa.model import CorrectiveModel
from porotwin_costa.network import NetworkSettings
from porotwin_costa.physics_id import PhysicsId
from porotwin_costa.training import TrainingSettings, train

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from rclpy.action import ActionClient  # noqa: E402
from rclpy.callback_groups import ReentrantCallbackGroup  # noqa: E402
from rclpy.executors import MultiThreadedExecutor  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from porotwin_core import conversions, qos  # noqa: E402
from porotwin_costa import trainer_node  # noqa: E402
from porotwin_msgs.action import Train  # noqa: E402
from porotwin_msgs.msg import CleanState, NewState, Outcome, WellRates  # noqa: E402
from porotwin_msgs.srv import (  # noqa: E402
    CorrectiveSource,
    DataModelInfo,
    LoadModel,
    Ping,
    Predict,
    Residual,
    SaveModel,
)

pytestmark = pytest.mark.graph

PATIENCE = 60.0
"""Longest wait for anything [s]; starting a process with torch takes several on a busy machine."""


class Client:
    """A node of the test, spun in a thread."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('test', context=self.context)
        self.executor = MultiThreadedExecutor(num_threads=3, context=self.context)
        self.executor.add_node(self.node)
        self.group = ReentrantCallbackGroup()
        threading.Thread(target=self.executor.spin, daemon=True).start()

    def wait(self, future: Any) -> Any:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        assert done.wait(PATIENCE), f'no answer in {PATIENCE} s'
        return future.result()

    def call(self, service: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(service, name, callback_group=self.group)
        assert client.wait_for_service(PATIENCE), f'{name} absent after {PATIENCE} s'
        return self.wait(client.call_async(request))

    def action(self, **goal: Any) -> tuple[Any, list[Any]]:
        feedback: list[Any] = []
        client = ActionClient(self.node, Train, 'costa/train', callback_group=self.group)
        assert client.wait_for_server(PATIENCE)
        handle = self.wait(
            client.send_goal_async(Train.Goal(**goal), lambda m: feedback.append(m.feedback))
        )
        return handle, feedback

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture(scope='module')
def client() -> Iterator[Client]:
    client = Client()
    yield client
    client.close()


@pytest.fixture(scope='module')
def rig_file(rig, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp('rig') / 'rig.yaml'
    write_rig(rig, path)
    return path


def _start(module: str, **parameters: Any) -> subprocess.Popen:
    arguments = [f'{name}:={value}' for name, value in parameters.items()]
    flags = [part for argument in arguments for part in ('-p', argument)]
    return subprocess.Popen(
        [sys.executable, '-m', f'porotwin_costa.{module}', '--ros-args', *flags],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def _stop(process: subprocess.Popen) -> str:
    process.send_signal(signal.SIGINT)
    try:
        out, errors = process.communicate(timeout=20)
    except subprocess.TimeoutExpired:
        process.kill()
        out, errors = process.communicate()
    return out + errors


@pytest.fixture
def costa(rig_file) -> Iterator[subprocess.Popen]:
    process = _start('costa_node', rig=rig_file, grid='30x20', architecture='local')
    yield process
    _stop(process)


@pytest.fixture(scope='module')
def dataset(rig, grid, model, training_frames):
    return build_dataset(
        training_frames,
        rig,
        grid=grid,
        time_step=30.0,
        predict=model.predict,
        residual=model.residual,
    )


@pytest.fixture(scope='module')
def trained(dataset):
    settings = TrainingSettings(
        network=NetworkSettings(architecture='local'),
        epochs=10,
        batch_size=4,
        learning_rate=5e-3,
    )
    return train(dataset, settings, seed=5)


def _question(model, frames, n=12) -> tuple[CorrectiveSource.Request, np.ndarray, dict]:
    rates = mean_rates(frames.schedule, frames.times[n], frames.times[n + 1])
    predicted = model.predict(frames.concentration[n], rates, 30.0)
    as_sent = conversions.tracer_to_msg(predicted, model.grid, 390.0)
    request = CorrectiveSource.Request(
        predicted=as_sent, wells=conversions.rates_to_msg(rates), time_step=30.0
    )
    return request, conversions.tracer_from_msg(as_sent)[0], rates


def test_costa_answers_as_the_model_it_loaded(
    client, costa, model, unseen_frames, trained, tmp_path
):
    request, predicted, rates = _question(model, unseen_frames)
    empty = client.call(CorrectiveSource, 'costa/corrective_source', request)
    assert empty.outcome.code == Outcome.OK
    assert not empty.active
    assert empty.status == 'no model loaded'
    assert not any(empty.source.source)
    assert client.call(Ping, 'costa/ping', Ping.Request()).status == 'no model loaded'
    assert not client.call(DataModelInfo, 'costa/info', DataModelInfo.Request()).loaded
    refused = client.call(SaveModel, 'costa/save', SaveModel.Request(path=str(tmp_path / 'x')))
    assert refused.outcome.code == Outcome.NOT_READY

    path = tmp_path / 'model.safetensors'
    trained.save(path)
    loaded = client.call(LoadModel, 'costa/load', LoadModel.Request(path=str(path)))
    assert loaded.outcome.code == Outcome.OK
    answer = client.call(CorrectiveSource, 'costa/corrective_source', request)
    assert answer.active
    assert answer.source.header == request.predicted.header
    sigma, _ = conversions.source_from_msg(answer.source)
    assert np.array_equal(sigma, trained.corrective_source(predicted, rates))

    info = client.call(DataModelInfo, 'costa/info', DataModelInfo.Request())
    assert (info.loaded, info.architecture, info.time_step) == (True, 'local', 30.0)
    assert info.path == str(path)
    copy = tmp_path / 'copy.safetensors'
    client.call(SaveModel, 'costa/save', SaveModel.Request(path=str(copy)))
    assert copy.read_bytes() == path.read_bytes()

    broken = tmp_path / 'broken.safetensors'
    broken.write_bytes(b'\x80\x04pickle')
    refused = client.call(LoadModel, 'costa/load', LoadModel.Request(path=str(broken)))
    assert refused.outcome.code == Outcome.INVALID_INPUT
    assert 'pickle' in refused.outcome.message
    request.wells[0].well = 'nobody'
    refused = client.call(CorrectiveSource, 'costa/corrective_source', request)
    assert refused.outcome.code == Outcome.INVALID_INPUT
    assert "'nobody'" in refused.outcome.message
    assert client.call(DataModelInfo, 'costa/info', DataModelInfo.Request()).loaded


def test_training_runs_beside_the_services_and_can_be_cancelled(
    client, costa, model, unseen_frames, dataset, tmp_path
):
    pairs, output = tmp_path / 'pairs.safetensors', tmp_path / 'model.safetensors'
    dataset.save(pairs)
    handle, feedback = client.action(dataset=str(pairs), epochs=100_000, seed=5)
    assert handle.accepted
    until = time.monotonic() + PATIENCE
    while not feedback and time.monotonic() < until:
        time.sleep(0.05)
    assert feedback[0].epoch == 1
    assert feedback[0].epochs == 100_000
    assert feedback[0].remaining > 0
    second, _ = client.action(dataset=str(pairs), epochs=1, seed=5)
    assert not second.accepted
    request, *_ = _question(model, unseen_frames)
    during = client.call(CorrectiveSource, 'costa/corrective_source', request)
    assert during.status == 'no model loaded'
    client.wait(handle.cancel_goal_async())
    cancelled = client.wait(handle.get_result_async()).result
    assert cancelled.outcome.code == Outcome.FAILED
    assert 'cancelled' in cancelled.outcome.message

    handle, feedback = client.action(dataset=str(pairs), output=str(output), epochs=8, seed=5)
    result = client.wait(handle.get_result_async()).result
    assert result.outcome.code == Outcome.OK, result.outcome.message
    assert result.samples == len(dataset)
    assert result.validation_loss < 1.0
    assert CorrectiveModel.load(output).provenance['seed'] == 5
    assert client.call(CorrectiveSource, 'costa/corrective_source', request).active

    handle, _ = client.action(dataset=str(tmp_path / 'absent'), seed=5)
    failed = client.wait(handle.get_result_async()).result
    assert failed.outcome.code == Outcome.INVALID_INPUT
    assert 'absent' in failed.outcome.message


def _solver(client: Client, model: Any) -> list[Any]:
    def answer(field: str, convert: Callable, work: Callable) -> Callable:
        def callback(request: Any, response: Any) -> Any:
            values = conversions.tracer_from_msg(request.previous)[0]
            rates = conversions.rates_from_msg(request.wells)
            try:
                result = work(request, values, rates)
            except InputError as error:
                response.outcome = conversions.refusal(error)
                return response
            setattr(response, field, convert(result, model.grid, 0.0))
            return response

        return callback

    def predict(request: Any, previous: np.ndarray, rates: dict) -> np.ndarray:
        return model.predict(previous, rates, request.time_step)

    def residual(request: Any, previous: np.ndarray, rates: dict) -> np.ndarray:
        following = conversions.tracer_from_msg(request.next)[0]
        return model.residual(previous, following, rates, request.time_step)

    make = client.node.create_service
    return [
        make(
            Predict,
            'solver/predict',
            answer('predicted', conversions.tracer_to_msg, predict),
            callback_group=client.group,
        ),
        make(
            Residual,
            'solver/residual',
            answer('residual', conversions.source_to_msg, residual),
            callback_group=client.group,
        ),
    ]


def test_trainer_collects_pairs_and_has_costa_trained(
    client, costa, rig_file, model, training_frames, tmp_path
):
    folder, output = tmp_path / 'pairs', tmp_path / 'model.safetensors'
    trainer = _start(
        'trainer_node',
        rig=rig_file,
        grid='30x20',
        dataset=folder,
        output=output,
        retrain_every=20,
        architecture='local',
    )
    states = client.node.create_publisher(NewState, 'asset/new_state', qos.FIELD)
    measured = client.node.create_publisher(WellRates, 'wells/measured', qos.FIELD)
    clean = client.node.create_publisher(CleanState, 'asset/clean_state', qos.FIELD)
    try:
        until = time.monotonic() + PATIENCE
        publishers = (states, measured, clean)
        while not all(one.get_subscription_count() for one in publishers):
            assert time.monotonic() < until, 'the trainer does not listen'
            time.sleep(0.05)
        time.sleep(1.0)  # seen by us, it need not have seen us yet: what it misses is lost
        sequence = 0
        for frames, begin in zip(training_frames, (0.0, 1000.0), strict=True):
            clean.publish(
                CleanState(header=conversions.header_at(begin), cause=0, reason=frames.name)
            )
            for n in range(13):
                start, end = begin + frames.times[n], begin + frames.times[n + 1]
                rates = conversions.rates_to_msg(
                    mean_rates(frames.schedule, start - begin, end - begin)
                )
                measured.publish(
                    WellRates(
                        header=conversions.header_at(end),
                        start=conversions.time_to_msg(start),
                        wells=rates,
                    )
                )
                seen = frames.concentration[n].copy()
                seen[:, 6:9] = np.nan  # a tube before the sand, for ever
                tracer = conversions.tracer_to_msg(seen, model.grid, start)
                states.publish(
                    NewState(header=conversions.header_at(start), sequence=sequence, tracer=tracer)
                )
                sequence += 1
                time.sleep(0.02)
        time.sleep(0.5)  # the last state first: topics may overtake each other
        clean.publish(CleanState(cause=CleanState.FINISHED, reason='over'))
        # the solver is started last: pairs wait for it
        services = _solver(client, model)
        until = time.monotonic() + PATIENCE
        while not output.exists():
            assert time.monotonic() < until, 'no model was trained'
            time.sleep(0.2)
        until = time.monotonic() + PATIENCE
        while not client.call(DataModelInfo, 'costa/info', DataModelInfo.Request()).loaded:
            assert time.monotonic() < until, 'the new model is not at work'
            time.sleep(0.2)
        assert len(services) == 2
    finally:
        report = _stop(trainer)
    dataset = load_dataset(folder)
    assert len(dataset) == 24, report
    assert len(np.unique(dataset.experiment)) == 2
    assert not dataset.residual[:, :, 6:9].any()
    corrective = CorrectiveModel.load(output)
    assert corrective.provenance['samples'] in (20, 24)
    assert 'Traceback' not in report


class LostTraining:
    """Stands for the action client: `ready`, and the goals it was given."""

    def __init__(self) -> None:
        self.ready = True
        self.goals: list[Any] = []

    def server_is_ready(self) -> bool:
        return self.ready

    def send_goal_async(self, goal: Any, feedback: Callable) -> Any:
        self.goals.append(goal)
        return rclpy.task.Future()  # it never comes


def test_a_training_that_costa_took_with_it_is_asked_for_again(client, rig_file, monkeypatch):
    monkeypatch.setattr(trainer_node, 'ActionClient', lambda *_: LostTraining())
    overrides = [Parameter('rig', value=str(rig_file)), Parameter('grid', value='30x20')]
    node = trainer_node.TrainerNode(context=client.context, parameter_overrides=overrides)
    node._training_due = True
    node._on_timer()
    node._on_timer()
    assert len(node._train.goals) == 1
    node._train.ready = False
    node._on_timer()
    node._train.ready = True
    node._on_timer()
    assert len(node._train.goals) == 2
    # started again before anybody saw it gone
    node._training_heard -= trainer_node.SILENCE_S + 1.0
    node._on_timer()
    assert len(node._train.goals) == 3
    node.destroy_node()


class Listener:
    """Stands for the node's logger."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warning(self, text: str, **_: Any) -> None:
        self.warnings.append(text)


def test_a_trainer_that_learns_nothing_says_why(client, rig_file, grid, monkeypatch):
    monkeypatch.setattr(trainer_node, 'ActionClient', lambda *_: LostTraining())
    overrides = [Parameter('rig', value=str(rig_file)), Parameter('grid', value='30x20')]
    node = trainer_node.TrainerNode(context=client.context, parameter_overrides=overrides)
    listener = Listener()
    monkeypatch.setattr(node, 'get_logger', lambda: listener)
    for n in range(4):
        tracer = conversions.tracer_to_msg(np.full(grid.shape, np.nan), grid, 30.0 * n)
        node._on_state(NewState(header=conversions.header_at(30.0 * n), sequence=n, tracer=tracer))
    assert listener.warnings == [
        f'0 training pairs so far; left out: {count} pairs with too little seen' for count in (1, 2)
    ]
    node.destroy_node()


def test_wrong_parameters_end_the_node_with_one_line(rig, rig_file, trained, tmp_path):
    broken = tmp_path / 'model.safetensors'
    broken.write_bytes(b'no model')
    other = tmp_path / 'other.safetensors'
    dataclasses.replace(trained, physics=PhysicsId.of(rig, 'upwind')).save(other)
    processes = [
        _start('costa_node', rig=rig_file, grid='30x20', model=other, preset='fast'),
        _start('costa_node', rig=tmp_path / 'none.yaml'),
        _start('costa_node', rig=rig_file, model=broken),
        _start('costa_node', rig=rig_file, architecture='cubist'),
    ]
    complaints = ("preset 'upwind'", 'none.yaml', 'safetensors', 'cubist')
    for process, complaint in zip(processes, complaints, strict=True):
        _, errors = process.communicate(timeout=2 * PATIENCE)
        assert process.returncode == 2
        assert errors.count('error: ') == 1
        assert complaint in errors
        assert 'Traceback' not in errors
