import dataclasses
import json
import pickle

import numpy as np
import pytest
import safetensors.numpy
import torch

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate
from porotwin_costa.dataset import build_dataset
from porotwin_costa.files import write_tensors
from porotwin_costa.model import APPLIED, FORMAT, NO_MODEL, CorrectiveModel, correction
from porotwin_costa.network import NetworkSettings
from porotwin_costa.physics_id import PhysicsId
from porotwin_costa.training import TrainingSettings, train

NETWORKS = {
    'paper': NetworkSettings(convolution_pool_layers=2, convolution_layers=1, filters=4),
    'local': NetworkSettings(architecture='local', filters=4),
}


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


@pytest.fixture(scope='module', params=list(NETWORKS))
def trained(request, dataset):
    settings = TrainingSettings(network=NETWORKS[request.param], epochs=8, learning_rate=3e-3)
    # the gate and the files are under test here, not the learning
    return dataclasses.replace(train(dataset, settings, seed=21), trust=0.9)


def _seen(dataset, number=12):
    told = dataset.rates[number]
    rates = {
        name: WellRate(rate, tracer / rate if rate > 0 else 0.0)
        for name, (rate, tracer) in zip(dataset.wells, told, strict=True)
    }
    return dataset.predicted[number].astype(float), rates


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
        question = _seen(dataset, number)
        assert np.array_equal(
            again.corrective_source(*question), trained.corrective_source(*question)
        )


def test_saving_twice_gives_the_same_bytes(trained, tmp_path):
    for name in 'abcdef':
        trained.save(tmp_path / name)
    assert len({path.read_bytes() for path in tmp_path.iterdir()}) == 1
    assert len(list(tmp_path.iterdir())) == 6


def test_correction_has_the_grid_and_comes_from_the_network(trained, dataset):
    answer = trained.assess(*_seen(dataset))
    assert answer.status == APPLIED
    assert answer.sigma.shape == dataset.grid.shape
    assert answer.sigma.any()
    assert np.array_equal(answer.sigma, trained.corrective_source(*_seen(dataset)))


def test_without_a_model_the_correction_is_zero_and_says_so(dataset):
    answer = correction(None, *_seen(dataset), 30.0)
    assert answer.status == NO_MODEL
    assert not answer.applied
    assert not answer.sigma.any()


def _withheld(answer, reason):
    assert not answer.applied
    assert answer.status.startswith('withheld: ')
    assert reason in answer.status
    assert '\n' not in answer.status
    assert not answer.sigma.any()
    return True


def test_another_time_step_is_withheld(trained, dataset):
    assert correction(trained, *_seen(dataset), 30.2).applied
    assert _withheld(correction(trained, *_seen(dataset), 300.0), 'trained for 30 s')


def test_pumping_beyond_the_training_is_withheld(trained, dataset):
    predicted, rates = _seen(dataset)
    stronger = {n: WellRate(3 * r.rate, r.concentration) for n, r in rates.items()}
    assert _withheld(trained.assess(predicted, stronger), 'outside the trained')


def test_concentration_beyond_the_training_is_withheld(trained, dataset):
    predicted, rates = _seen(dataset)
    assert _withheld(trained.assess(predicted + 0.5, rates), 'concentration')


def test_unknown_cells_are_withheld(trained, dataset):
    predicted, rates = _seen(dataset)
    predicted[4, 5] = np.nan
    assert _withheld(trained.assess(predicted, rates), 'unknown cells')


def test_paper_network_does_not_answer_for_a_well_it_never_saw_pump(dataset):
    only_left = dataset.select(dataset.experiment == 0)
    settings = TrainingSettings(network=NETWORKS['paper'], epochs=2)
    trained = dataclasses.replace(train(only_left, settings, seed=21), trust=1.0)
    predicted, _ = _seen(dataset)
    rate = from_ml_h(400.0)
    rates = {'right': WellRate(rate, 1.0), 'producer': WellRate(-rate)}
    assert _withheld(trained.assess(predicted, rates), "rate of 'left'")


class _Constant(torch.nn.Module):
    """Answers the same number everywhere."""

    def __init__(self, value):
        super().__init__()
        self.value = value

    def forward(self, concentration, rates):
        return torch.full_like(concentration, self.value)


def _spoilt(trained, value):
    return dataclasses.replace(trained, network=_Constant(value))


def test_answers_that_are_not_finite_are_withheld(trained, dataset):
    assert _withheld(_spoilt(trained, np.nan).assess(*_seen(dataset)), 'not finite')


def test_implausibly_large_answers_are_withheld(trained, dataset):
    assert _withheld(_spoilt(trained, 1e4).assess(*_seen(dataset)), 'exceeds the plausible')


def test_prediction_on_another_grid_is_refused(trained, dataset):
    with pytest.raises(InputError, match='30x20'):
        trained.assess(np.zeros((7, 7)), {})


def test_model_is_held_against_the_rig(trained, grid, rig):
    assert trained.for_wells(tuple(rig.wells), grid) is trained
    with pytest.raises(InputError, match='train for it'):
        trained.for_wells(tuple(rig.wells), rig.grid(31, 20))
    with pytest.raises(InputError, match='left, right, producer: the rig has a'):
        trained.for_wells(('a',), grid)


def test_model_is_held_against_the_physics_it_corrects(trained, grid, rig, tmp_path):
    path = tmp_path / 'model.safetensors'
    upwind = dataclasses.replace(trained, physics=PhysicsId.of(rig, 'upwind'))
    upwind.save(path)
    again = CorrectiveModel.load(path)
    assert again.for_physics(rig, grid, 'upwind') is again
    assert not again.doubt
    with pytest.raises(InputError, match="preset 'upwind', not 'fast'") as refusal:
        again.for_physics(rig, grid, 'fast')
    assert '\n' not in str(refusal.value)
    sorbing = EffectDescription(name='sorption', parameters={'retardation_factor': 1.2})
    for belief in ({'permeability_m2': 1e-9}, {'effects': (sorbing,)}):
        with pytest.raises(InputError, match=r'rig .*, not .*effects of rig.yaml'):
            again.for_physics(rig.model_copy(update=belief), grid, 'upwind')


def test_older_model_is_taken_with_a_doubt(trained, grid, rig, tmp_path):
    path = tmp_path / 'model.safetensors'
    description = trained.description()
    del description['physics']
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


def test_cut_file_is_refused(tmp_path, trained):
    path = tmp_path / 'model.safetensors'
    trained.save(path)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match='not a safetensors file'):
        CorrectiveModel.load(path)


def test_weights_that_do_not_fit_the_description_are_refused(tmp_path, trained):
    path = tmp_path / 'model.safetensors'
    dataclasses.replace(trained, settings=dataclasses.replace(trained.settings, filters=5)).save(
        path
    )
    with pytest.raises(InputError, match='damaged model') as refusal:
        CorrectiveModel.load(path)
    assert '\n' not in str(refusal.value)


def test_folder_that_cannot_be_written_is_one_line(tmp_path, trained):
    (tmp_path / 'file').write_text('in the way')
    with pytest.raises(InputError, match='cannot be written'):
        trained.save(tmp_path / 'file' / 'model.safetensors')
