"""A trained model: its file, and the rigs that it fits."""

import dataclasses
import json
import pickle

import numpy as np
import pytest
import safetensors.numpy
import torch
from costa_examples import question

from porotwin_core.basis.errors import InputError
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rig import EffectDescription
from porotwin_costa.correction.corrective_model import FORMAT, CorrectiveModel
from porotwin_costa.correction.corrective_source import corrective_source
from porotwin_costa.data.physics_id import PhysicsId
from porotwin_costa.data.tensor_files import write_tensors
from porotwin_costa.networks import architecture
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.training import train

NETWORKS = {
    'paper': architecture('paper').described(
        {'convolution_pool_layers': 2, 'convolution_layers': 1, 'filters': 4}
    ),
    'local': architecture('local').described({'filters': 4}),
}

VERSION_0_1_SETTINGS = {
    'convolution_pool_layers': 5,
    'convolution_layers': 0,
    'dense_layers': 3,
    'dense_nodes': 100,
    'filters': 16,
}
"""Listed by files of version 0.1, whatever the architecture."""


@pytest.fixture(scope='module', params=list(NETWORKS))
def trained(request, dataset):
    settings = TrainingSettings(epochs=8, learning_rate=3e-3, patience=40)
    # these tests are about gate and files, not about learning
    return dataclasses.replace(
        train(dataset, NETWORKS[request.param], settings, seed=21), trust=0.9
    )


def test_saved_model_comes_back_bit_for_bit(trained, dataset, tmp_path):
    path = tmp_path / 'model.safetensors'
    trained.save(path)
    again = CorrectiveModel.load(path)
    for name, value in trained.network.state_dict().items():
        assert torch.equal(again.network.state_dict()[name], value)
    assert json.dumps(again.description()) == json.dumps(trained.description())
    assert dataclasses.replace(again, network=trained.network, provenance=0) == (
        dataclasses.replace(trained, provenance=0)
    )
    for number in (3, 12, 30):
        ours, theirs = (
            corrective_source(one, *question(dataset, number)) for one in (trained, again)
        )
        assert np.array_equal(ours.sigma, theirs.sigma)
        assert ours.status == theirs.status


def test_saving_twice_gives_the_same_bytes(trained, tmp_path):
    for name in 'abcdef':
        trained.save(tmp_path / name)
    assert len({path.read_bytes() for path in tmp_path.iterdir()}) == 1
    assert len(list(tmp_path.iterdir())) == 6


def test_model_for_other_wells_or_another_grid_is_refused(trained, grid, rig):
    assert trained.for_wells(tuple(rig.wells), grid) is trained
    with pytest.raises(InputError, match='train for it'):
        trained.for_wells(tuple(rig.wells), rig.grid(31, 20))
    with pytest.raises(InputError, match='left, right, producer: the rig has a'):
        trained.for_wells(('a',), grid)


def test_model_for_another_preset_or_rig_is_refused(trained, grid, rig, tmp_path):
    path = tmp_path / 'model.safetensors'
    upwind = dataclasses.replace(trained, physics=PhysicsId.of(rig, 'upwind'))
    upwind.save(path)
    again = CorrectiveModel.load(path)
    assert again.for_physics(rig, grid, 'upwind') is again
    assert not again.doubt
    with pytest.raises(InputError, match="not 'fast'; run with --preset upwind") as refusal:
        again.for_physics(rig, grid, 'fast')
    assert '\n' not in str(refusal.value)
    sorbing = EffectDescription(name='sorption', parameters={'retardation_factor': 1.2})
    for change in ({'permeability_m2': 1e-9}, {'effects': (sorbing,)}):
        with pytest.raises(InputError, match=r'rig .*, not .*effects of rig.yaml'):
            again.for_physics(rig.model_copy(update=change), grid, 'upwind')


def test_model_of_version_0_1_is_used_with_a_warning(trained, grid, rig, tmp_path):
    path = tmp_path / 'model.safetensors'
    description = trained.description()
    del description['physics']
    description['network'] = {**VERSION_0_1_SETTINGS, **description['network']}
    weights = {name: value.numpy() for name, value in trained.network.state_dict().items()}
    weights.pop('relative_depth', None)
    write_tensors(path, weights, FORMAT, description)
    old = CorrectiveModel.load(path)
    assert old.for_physics(rig, grid, 'fast') is old
    assert 'does not say which rig and preset' in old.doubt
    assert '\n' not in old.doubt


def test_pickles_are_refused_unread(tmp_path, trained):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ('a pickle was opened',))

    plain, archive = tmp_path / 'plain.safetensors', tmp_path / 'archive.safetensors'
    plain.write_bytes(pickle.dumps(Trap()))
    torch.save(trained.network.state_dict(), archive)
    for path in (plain, archive):
        with pytest.raises(InputError, match='a pickle, which may run code'):
            CorrectiveModel.load(path)


def test_files_of_another_kind_are_refused(tmp_path, dataset):
    foreign, pairs = tmp_path / 'foreign.safetensors', tmp_path / 'pairs.safetensors'
    safetensors.numpy.save_file({'a': np.zeros(3)}, foreign)
    dataset.save(pairs)
    with pytest.raises(InputError, match='another program'):
        CorrectiveModel.load(foreign)
    with pytest.raises(InputError, match='costa-dataset'):
        CorrectiveModel.load(pairs)
    safetensors.numpy.save_file({'a': np.zeros(3)}, foreign, {'porotwin': '[1'})
    with pytest.raises(InputError, match='description is damaged'):
        CorrectiveModel.load(foreign)
    with pytest.raises(InputError, match='cannot be read'):
        CorrectiveModel.load(tmp_path / 'absent.safetensors')


def test_truncated_file_is_refused(tmp_path, trained):
    path = tmp_path / 'model.safetensors'
    trained.save(path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match='not a safetensors file'):
        CorrectiveModel.load(path)


def test_weights_that_do_not_fit_the_description_are_refused(tmp_path, trained):
    path = tmp_path / 'model.safetensors'
    wrong = trained.architecture.described({'filters': 5})
    dataclasses.replace(trained, architecture=wrong).save(path)
    with pytest.raises(InputError, match='damaged model') as refusal:
        CorrectiveModel.load(path)
    assert '\n' not in str(refusal.value)


def test_folder_that_cannot_be_written_is_one_line(tmp_path, trained):
    (tmp_path / 'file').write_text('in the way')
    with pytest.raises(InputError, match='cannot be written'):
        trained.save(tmp_path / 'file' / 'model.safetensors')


def test_unknown_architecture_is_refused(trained, tmp_path):
    description = trained.description()
    description['network'] = {'architecture': 'transformer'}
    path = tmp_path / 'model.safetensors'
    write_tensors(path, {'weight': np.zeros(1)}, FORMAT, description)
    with pytest.raises(InputError, match="'transformer': unknown; choose from"):
        CorrectiveModel.load(path)


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        ({'time_step': 'abc'}, 'damaged model'),
        ({'time_step': 0.0}, 'must be positive'),
        ({'trust': float('nan')}, 'trust of the model holds no finite number'),
        ({'trust': 5.0}, 'trust 5 is not from 0 to 1'),
        ({'provenance': None}, 'damaged model'),
        ({'provenance': {}}, 'damaged model'),
        ({'grid': {'nx': 10**7, 'nz': 10**7, 'width': 1.0, 'height': 1.0}}, 'damaged model'),
        ({'grid': {'nx': 0, 'nz': 9, 'width': 1.0, 'height': 1.0}}, 'needs at least one cell'),
        ({'scaling': {'offset': 0.0, 'spread': 0.0, 'rate': 1.0, 'sigma': 1.0}}, 'positive'),
        ({'scaling': {'offset': 'a', 'spread': 1.0, 'rate': 1.0, 'sigma': 1.0}}, 'damaged model'),
        ({'trained_on': {'pumping': []}}, 'damaged model'),
        ({'trained_on': {'rates': []}}, 'a range for every well'),
        ({'trained_on': {'largest_residual': float('inf')}}, 'largest_residual of the model'),
        (
            {'learnt': {'effects': [{'name': 'leak', 'parameters': {'x': float('nan')}}]}},
            'damaged model',
        ),
    ],
)
def test_numbers_that_no_training_leaves_are_refused(trained, tmp_path, change, complaint):
    path = tmp_path / 'model.safetensors'
    learnt = dataclasses.replace(trained, learnt=LearntPhysics())
    description = json.loads(json.dumps(learnt.description()))
    for key, value in change.items():
        merged = isinstance(value, dict) and value
        description[key] = {**description[key], **value} if merged else value
    weights = {name: value.numpy() for name, value in trained.network.state_dict().items()}
    write_tensors(path, weights, FORMAT, description)
    with pytest.raises(InputError, match=complaint) as refusal:
        CorrectiveModel.load(path)
    assert str(refusal.value).startswith(f'{path}: ')
    assert '\n' not in str(refusal.value)


def test_weights_that_are_no_numbers_are_refused(trained, tmp_path):
    path = tmp_path / 'model.safetensors'
    weights = {name: value.numpy().copy() for name, value in trained.network.state_dict().items()}
    name = next(name for name in weights if name.endswith('weight'))
    weights[name].flat[0] = np.nan
    write_tensors(path, weights, FORMAT, trained.description())
    with pytest.raises(InputError, match=rf'{name} of the model holds no finite number'):
        CorrectiveModel.load(path)
