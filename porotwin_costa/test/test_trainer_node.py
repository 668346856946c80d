"""The trainer as a real process: pairs and weights in files, which a restart finds."""

import subprocess
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from costa_graph import HIDDEN, Asset, Client, offer_solver, start, stop  # noqa: E402
from rcl_interfaces.msg import Log  # noqa: E402
from rclpy.action import ActionServer  # noqa: E402

from porotwin_core.basis.errors import InputError  # noqa: E402
from porotwin_costa.correction.corrective_model import CorrectiveModel  # noqa: E402
from porotwin_costa.data.dataset import load_dataset  # noqa: E402
from porotwin_costa.data.physics_id import PhysicsId  # noqa: E402
from porotwin_costa.trainer_node import known_pairs  # noqa: E402
from porotwin_costa.training.live_training import not_used  # noqa: E402
from porotwin_msgs.action import Train  # noqa: E402
from porotwin_msgs.srv import DataModelInfo  # noqa: E402

FRAMES = 13
"""Frames of an experiment: twelve pairs."""


@pytest.fixture
def client(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Client]:
    """A client in a domain of its own: a trainer waits for another one that it finds."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    client = Client()
    yield client
    client.close()


@pytest.fixture
def node(client) -> Iterator[Callable[..., subprocess.Popen]]:
    """Starts nodes, and ends those that still run after the test."""
    processes = []

    def begin(module: str, **parameters: Any) -> subprocess.Popen:
        processes.append(start(module, **parameters))
        return processes[-1]

    yield begin
    for process in processes:
        if process.poll() is None:
            stop(process)


@pytest.fixture
def twin(node, rig_file, tmp_path):
    """Return a function that starts a trainer with its files in the test's folder."""

    def trainer(**parameters):
        return node(
            'trainer_node',
            rig=rig_file,
            dataset=tmp_path / 'run' / 'pairs',
            output=tmp_path / 'run' / 'model.safetensors',
            retrain_every=20,
            **parameters,
        )

    return trainer


@pytest.fixture
def asset(client, model) -> Iterator[Asset]:
    asset = Asset(client, model)
    yield asset
    asset.close()


@pytest.mark.graph
def test_trainer_keeps_pairs_and_weights_in_files_and_continues_after_a_restart(
    client, rig_file, model, training_frames, unseen_frames, node, twin, asset, tmp_path
):
    folder, output = tmp_path / 'run' / 'pairs', tmp_path / 'run' / 'model.safetensors'
    node('costa_node', rig=rig_file, architecture='local')
    trainer = twin(architecture='local')
    asset.wait_for_trainer(trainer)
    for frames, begin in zip(training_frames, (0.0, 1000.0), strict=True):
        asset.experiment(frames, begin, FRAMES)
    asset.finish()
    # the solver is started last: pairs wait for it
    services = offer_solver(client, model)
    try:
        client.until('no model was trained', output.exists, trainer)
        client.until(
            'the new model is not used',
            lambda: client.call(DataModelInfo, 'costa/info', DataModelInfo.Request()).loaded,
        )
        report = stop(trainer)
        dataset = load_dataset(folder)
        assert len(dataset) == 24, report
        assert len(np.unique(dataset.experiment)) == 2
        assert not dataset.residual[:, :, HIDDEN].any()
        corrective = CorrectiveModel.load(output)
        assert corrective.architecture.name == 'local'
        assert corrective.provenance['samples'] in (20, 24)
        assert 'Traceback' not in report

        # the restarted trainer adds to the pairs, and trains with the fortieth
        first_weights = output.read_bytes()
        trainer = twin()
        asset.wait_for_trainer(trainer)
        asset.experiment(unseen_frames, 2000.0, 20)
        asset.finish()
        client.until(
            'no second training',
            lambda: output.read_bytes() != first_weights or not_used(output).exists(),
            trainer,
        )
    finally:
        for service in services:
            client.solver.destroy_service(service)
    report = stop(trainer)
    assert f'training pairs in {folder}: 24 so far' in report
    dataset = load_dataset(folder)
    assert len(dataset) == 43, report
    assert np.unique(dataset.experiment).tolist() == [0, 1, 2]
    newest = not_used(output) if not_used(output).exists() else output
    corrective = CorrectiveModel.load(newest)
    assert corrective.architecture.name == 'local'
    assert corrective.provenance['samples'] in (40, 43)


@pytest.mark.graph
def test_a_trainer_sends_no_goal_while_a_stranger_offers_training(
    client, model, training_frames, twin, asset, tmp_path
):
    goals, lines = [], []
    stranger = rclpy.create_node('stranger', context=client.node.context)

    def take(goal):
        goals.append(goal)
        goal.succeed()
        return Train.Result()

    client.spin(stranger)
    server = ActionServer(stranger, Train, 'costa/train', take)
    client.node.create_subscription(Log, '/rosout', lambda log: lines.append(log.msg), 100)
    trainer = twin()
    asset.wait_for_trainer(trainer)
    services = offer_solver(client, model)
    try:
        for frames, begin in zip(training_frames, (0.0, 1000.0), strict=True):
            asset.experiment(frames, begin, FRAMES)
        asset.finish()
        refusal = '/stranger offers costa/train too, and only /costa may'
        client.until('it is not refused', lambda: any(refusal in line for line in lines))
        folder = tmp_path / 'run' / 'pairs'
        client.until('no pairs', lambda: folder.is_dir() and len(load_dataset(folder)) >= 20)
        time.sleep(1.5)  # three looks whether a training is due
    finally:
        for service in services:
            client.solver.destroy_service(service)
        server.destroy()
        stranger.destroy_node()
    assert goals == [], stop(trainer)


@pytest.mark.graph
def test_a_trainer_that_collects_nothing_says_why(twin, model, asset):
    trainer = twin()
    asset.wait_for_trainer(trainer)
    for number in range(4):
        asset.state(30.0 * number, np.full(model.grid.shape, np.nan))
    asset.finish()
    report = stop(trainer)
    assert '0 training pairs so far; left out: 1 pairs with too little seen' in report


def test_pairs_of_another_twin_are_refused(dataset, rig, tmp_path):
    assert known_pairs(tmp_path, dataset.grid, 30.0, dataset.physics) is None
    dataset.append_to(tmp_path)
    assert len(known_pairs(tmp_path, dataset.grid, 30.0, dataset.physics)) == 48
    with pytest.raises(InputError, match='the twin runs on 31x20 every 30 s; name another folder'):
        known_pairs(tmp_path, rig.grid(31, 20), 30.0, dataset.physics)
    with pytest.raises(InputError, match='every 60 s; name another folder'):
        known_pairs(tmp_path, dataset.grid, 60.0, dataset.physics)
    other = PhysicsId.of(rig.model_copy(update={'porosity': 0.4}), 'upwind')
    with pytest.raises(InputError, match=r'holds pairs of rig .*; name another folder'):
        known_pairs(tmp_path, dataset.grid, 30.0, other)
