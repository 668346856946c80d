"""The node of COSTA as a real process: services, training, parameters."""

import dataclasses
import itertools
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np
import pytest
from patience import until
from refused_node import refusal

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from costa_graph import GRID, start, stop  # noqa: E402

from porotwin_core.rig import EffectDescription  # noqa: E402
from porotwin_core.ros import (  # noqa: E402
    conversions,
    qos,
)
from porotwin_costa import costa_node, trainer_node  # noqa: E402
from porotwin_costa.correction.corrective_model import CorrectiveModel  # noqa: E402
from porotwin_costa.correction.corrective_source import corrective_source  # noqa: E402
from porotwin_costa.data.dataset import pairs_beside  # noqa: E402
from porotwin_costa.data.physics_id import PhysicsId  # noqa: E402
from porotwin_costa.networks import architecture  # noqa: E402
from porotwin_costa.networks.training_settings import TrainingSettings  # noqa: E402
from porotwin_costa.training.live_training import not_used  # noqa: E402
from porotwin_costa.training.training import train  # noqa: E402
from porotwin_msgs.msg import ModelEffects, Outcome  # noqa: E402
from porotwin_msgs.srv import (  # noqa: E402
    CorrectiveSource,
    DataModelInfo,
    LoadModel,
    Ping,
    SaveModel,
)

pytestmark = pytest.mark.graph

LOADS = 10
"""Requests at least, beside a training or after it."""


@pytest.fixture
def costa(rig_file) -> Iterator[subprocess.Popen]:
    process = start('costa_node', rig=rig_file, architecture='local')
    yield process
    stop(process)


@pytest.fixture(scope='module')
def trained(dataset):
    settings = TrainingSettings(epochs=10, batch_size=4, learning_rate=5e-3, patience=40)
    return train(dataset, architecture('local'), settings, seed=5)


def test_a_node_without_a_model_does_not_load_torch():
    code = 'import sys, porotwin_costa.costa_node; sys.exit("torch" in sys.modules)'
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0


def _question(model, frames, n=12) -> tuple[CorrectiveSource.Request, np.ndarray, dict]:
    rates = frames.schedule.mean(frames.times[n], frames.times[n + 1])
    predicted = model.predict(frames.concentration[n], rates, 30.0)
    as_sent = conversions.tracer_to_msg(predicted, model.grid, 390.0)
    request = CorrectiveSource.Request(
        predicted=as_sent,
        wells=conversions.rates_to_msg(rates),
        time_step=conversions.duration_to_msg(30.0),
    )
    return request, conversions.tracer_from_msg(as_sent)[0], rates


def test_costa_answers_like_the_model_that_it_loaded(
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
    assert np.array_equal(sigma, corrective_source(trained, predicted, rates, 30.0).sigma)

    solver = rclpy.create_node('solver', context=client.node.context)
    told = solver.create_publisher(ModelEffects, 'model/effects', qos.CONFIG)
    effect = EffectDescription(name='retardation', parameters={'retardation_factor': 1.2})
    told.publish(ModelEffects(sequence=1, effects=[conversions.effect_to_msg(effect)]))

    def answered() -> CorrectiveSource.Response:
        return client.call(CorrectiveSource, 'costa/corrective_source', request)

    client.until('the gate closes', lambda: not answered().active)
    assert 'COSTA must learn the remainder first' in answered().status
    told.publish(ModelEffects(sequence=2))
    client.until('the gate opens', lambda: answered().active)

    stranger = client.node.create_publisher(ModelEffects, 'model/effects', qos.CONFIG)
    stranger.publish(ModelEffects(effects=[conversions.effect_to_msg(effect)]))
    client.until('it has arrived', lambda: stranger.wait_for_all_acked())
    assert answered().active, 'only the solver tells its effects'
    solver.destroy_node()

    info = client.call(DataModelInfo, 'costa/info', DataModelInfo.Request())
    assert (info.loaded, info.architecture, info.time_step.sec) == (True, 'local', 30)
    assert info.path == str(path)
    copy = tmp_path / 'copy.safetensors'
    client.call(SaveModel, 'costa/save', SaveModel.Request(path=str(copy)))
    assert copy.read_bytes() == path.read_bytes()

    broken = tmp_path / 'broken.safetensors'
    broken.write_bytes(b'\x80\x04pickle')
    refused = client.call(LoadModel, 'costa/load', LoadModel.Request(path=str(broken)))
    assert refused.outcome.code == Outcome.INVALID_INPUT
    assert 'pickle' in refused.outcome.message
    for path in ('/' + 5000 * 'a', str(broken / 'below')):
        for kind, name in ((LoadModel, 'costa/load'), (SaveModel, 'costa/save')):
            refused = client.call(kind, name, kind.Request(path=path))
            assert refused.outcome.code == Outcome.INVALID_INPUT
            assert len(refused.outcome.message) < 600
    request.wells[0].well = 'nobody'
    refused = client.call(CorrectiveSource, 'costa/corrective_source', request)
    assert refused.outcome.code == Outcome.INVALID_INPUT
    assert "'nobody'" in refused.outcome.message
    assert client.call(DataModelInfo, 'costa/info', DataModelInfo.Request()).loaded


def test_who_does_not_vouch_has_nothing_loaded_saved_or_trained(
    client, costa, dataset, trained, tmp_path
):
    model, pairs, new = (tmp_path / f'{name}.safetensors' for name in ('model', 'pairs', 'new'))
    trained.save(model)
    dataset.save(pairs)
    for kind, name, path in ((LoadModel, 'costa/load', model), (SaveModel, 'costa/save', new)):
        request = kind.Request(path=str(path))
        refused = client.call(kind, name, request, vouched=False)
        assert f'a program calls {name}, and only /terminal may' in refused.outcome.message
    assert not client.call(DataModelInfo, 'costa/info', DataModelInfo.Request()).loaded
    handle, _ = client.action(vouched=False, dataset=str(pairs), output=str(new), epochs=1)
    assert not handle.accepted
    assert not new.exists()


def test_only_a_model_is_overwritten(client, costa, dataset, trained, tmp_path):
    model, pairs = tmp_path / 'model.safetensors', tmp_path / 'pairs.safetensors'
    trained.save(model)
    dataset.save(pairs)
    rates = tmp_path / 'rates.csv'
    rates.write_text('precious')
    for load in (model, None):
        kind, name = (LoadModel, 'costa/load') if load else (SaveModel, 'costa/save')
        answer = client.call(kind, name, kind.Request(path=str(model)))
        assert answer.outcome.code == Outcome.OK, answer.outcome.message
    for other in (rates, pairs):
        kept = other.read_bytes()
        refused = client.call(SaveModel, 'costa/save', SaveModel.Request(path=str(other)))
        assert refused.outcome.code == Outcome.INVALID_INPUT
        assert 'holds no COSTA model' in refused.outcome.message
        handle, _ = client.action(dataset=str(pairs), output=str(other), epochs=1, seed=5)
        outcome = client.wait(handle.get_result_async()).result.outcome
        assert outcome.code == Outcome.INVALID_INPUT
        assert 'holds no COSTA model' in outcome.message
        assert other.read_bytes() == kept


def test_training_runs_beside_the_services_and_can_be_cancelled(
    client, costa, model, unseen_frames, dataset, tmp_path
):
    pairs, output = tmp_path / 'pairs.safetensors', tmp_path / 'model.safetensors'
    dataset.save(pairs)
    handle, feedback = client.action(dataset=str(pairs), epochs=100_000, seed=5)
    assert handle.accepted
    # those before tell that it prepares
    first = until(lambda: next((one for one in feedback if one.epoch), None))
    assert first.epoch == 1
    assert first.epochs == 100_000
    assert conversions.seconds_from_msg(first.remaining) > 0
    second, _ = client.action(dataset=str(pairs), epochs=1, seed=5)
    assert not second.accepted
    request, *_ = _question(model, unseen_frames)
    during = client.call(CorrectiveSource, 'costa/corrective_source', request)
    assert during.status == 'no model loaded'
    assert client.wait(client.voucher.cancel('costa/train', handle)).goals_canceling
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

    handle, _ = client.action(dataset=str(pairs), epochs=30, seed=5)
    assert not client.wait(handle.cancel_goal_async()).goals_canceling  # nobody vouches for it
    assert client.wait(handle.get_result_async()).result.outcome.code == Outcome.OK

    handle, _ = client.action(dataset=str(tmp_path / 'absent'), seed=5)
    failed = client.wait(handle.get_result_async()).result
    assert failed.outcome.code == Outcome.INVALID_INPUT
    assert 'absent' in failed.outcome.message


def test_models_loaded_beside_a_training_are_whole_and_stay(
    client, costa, model, unseen_frames, dataset, trained, tmp_path
):
    pairs, output = tmp_path / 'pairs.safetensors', tmp_path / 'output.safetensors'
    dataset.save(pairs)
    other = train(dataset, architecture('local'), TrainingSettings(epochs=5, patience=40), seed=6)
    request, predicted, rates = _question(model, unseen_frames)
    files, answers = [], []
    for number, each in enumerate((trained, other)):
        files.append(str(tmp_path / f'{number}.safetensors'))
        each.save(files[-1])
        answers.append(corrective_source(each, predicted, rates, 30.0).sigma)
    handle, _ = client.action(dataset=str(pairs), output=str(output), epochs=40, seed=5)
    result = handle.get_result_async()
    loads = itertools.cycle(files)
    count = 0
    while not result.done() or count < LOADS:
        loaded = client.call(LoadModel, 'costa/load', LoadModel.Request(path=next(loads)))
        assert loaded.outcome.code == Outcome.OK, loaded.outcome.message
        answer = client.call(CorrectiveSource, 'costa/corrective_source', request)
        sigma, _ = conversions.source_from_msg(answer.source)
        assert any(np.array_equal(sigma, one) for one in answers), 'half of two models'
        count += 1
        time.sleep(0.1)  # nobody reads the log of the node: hundreds of loads fill its pipe
    assert client.wait(result).result.outcome.code == Outcome.OK
    # the training began before them, so that it replaces none of them
    info = client.call(DataModelInfo, 'costa/info', DataModelInfo.Request())
    assert info.path in files
    assert not output.exists()
    assert CorrectiveModel.load(not_used(output)).provenance['seed'] == 5


def test_the_loaded_model_decides_which_network_is_trained(
    client, rig_file, trained, dataset, tmp_path
):
    pairs, start_model = tmp_path / 'pairs.safetensors', tmp_path / 'start.safetensors'
    output = tmp_path / 'output.safetensors'
    dataset.save(pairs)
    small = trained.architecture.described({'filters': 4})
    quick = train(dataset, small, TrainingSettings(epochs=1, patience=40), seed=5)
    quick.save(start_model)
    process = start('costa_node', rig=rig_file, model=start_model, trained_model=output)
    try:
        goal = {'dataset': str(pairs), 'output': str(output), 'epochs': 1, 'seed': 5}
        handle, _ = client.action(**goal)
        result = client.wait(handle.get_result_async()).result
        assert result.outcome.code == Outcome.OK, result.outcome.message
        # the same training again is no better, so that the old weights stay in use
        assert CorrectiveModel.load(not_used(output)).architecture == small
        handle, _ = client.action(**{**goal, 'output': ''})  # its weights go nowhere
        result = client.wait(handle.get_result_async()).result
        assert result.outcome.code == Outcome.OK, result.outcome.message
        refused = client.call(SaveModel, 'costa/save', SaveModel.Request(path=''))
        assert refused.outcome.code == Outcome.INVALID_INPUT
        other = tmp_path / 'other.safetensors'
        handle, _ = client.action(**{**goal, 'output': str(other)}, architecture='paper')
        client.wait(handle.get_result_async())
        written = other if other.exists() else not_used(other)
        assert CorrectiveModel.load(written).architecture == architecture('paper')
    finally:
        stop(process)
    # started again, the node uses the trained weights instead of the first model, and still learns
    # from the pairs of that one
    quick.save(output)
    dataset.save(pairs_beside(start_model))
    process = start('costa_node', rig=rig_file, model=start_model, trained_model=output)
    try:
        info = client.call(DataModelInfo, 'costa/info', DataModelInfo.Request())
        assert info.path == str(output)
        handle, _ = client.action(**goal)
        result = client.wait(handle.get_result_async()).result
        assert result.samples == 2 * len(dataset)
    finally:
        stop(process)


def test_wrong_parameters_end_the_node_with_one_line(
    rig, rig_file, trained, tmp_path, monkeypatch, capfd
):
    broken = tmp_path / 'model.safetensors'
    broken.write_bytes(b'no model')
    other = tmp_path / 'other.safetensors'
    dataclasses.replace(trained, physics=PhysicsId.of(rig, 'upwind')).save(other)
    for main, parameters, complaint in (
        (costa_node.main, {'rig': rig_file, 'model': other, 'preset': 'fast'}, "preset 'upwind'"),
        (costa_node.main, {'rig': tmp_path / 'none.yaml'}, 'none.yaml'),
        (costa_node.main, {'rig': rig_file, 'model': broken}, 'safetensors'),
        (costa_node.main, {'rig': rig_file, 'architecture': 'cubist'}, 'cubist'),
        (trainer_node.main, {'rig': rig_file}, 'dataset'),
    ):
        errors = refusal(main, monkeypatch, capfd, grid=GRID, **parameters)
        assert errors.count('error: ') == 1
        assert complaint in errors
        assert 'Traceback' not in errors
