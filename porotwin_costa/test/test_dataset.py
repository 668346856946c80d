"""Data sets: files, parts, joining and identity."""

import dataclasses

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_costa.data.dataset import (
    FORMAT,
    empty_dataset,
    join_datasets,
    load_dataset,
    newest_pairs,
)
from porotwin_costa.data.physics_id import PhysicsId
from porotwin_costa.data.tensor_files import write_tensors


def test_file_gives_back_the_same_data_set(build, unseen_frames, tmp_path):
    dataset = build(unseen_frames)
    dataset.save(tmp_path / 'pairs.safetensors')
    again = load_dataset(tmp_path / 'pairs.safetensors')
    assert again.fingerprint == dataset.fingerprint
    assert again.grid == dataset.grid
    assert again.wells == dataset.wells
    assert again.summary == dataset.summary
    for name in ('predicted', 'residual', 'rates', 'time', 'experiment'):
        assert np.array_equal(getattr(again, name), getattr(dataset, name))


def test_parts_appended_to_a_folder_are_one_data_set(build, unseen_frames, tmp_path):
    dataset = build(unseen_frames)
    early = dataset.time < 300
    dataset.select(early).append_to(tmp_path / 'pairs')
    dataset.select(~early).append_to(tmp_path / 'pairs')
    whole = load_dataset(tmp_path / 'pairs')
    assert np.array_equal(whole.residual, dataset.residual)
    assert len(np.unique(whole.experiment)) == 1


def test_the_newest_parts_are_read_until_they_are_enough(build, unseen_frames, tmp_path):
    dataset = build(unseen_frames)
    for low in (0, 5, 10):
        dataset.select(np.arange(low, low + 5)).append_to(tmp_path)
    assert np.array_equal(newest_pairs(tmp_path, 6).time, dataset.time[5:15])
    assert np.array_equal(newest_pairs(tmp_path, 1000).time, dataset.time[:15])
    (tmp_path / 'empty').mkdir()
    with pytest.raises(InputError, match=r'holds no part_'):
        newest_pairs(tmp_path / 'empty', 5)


def test_joined_experiments_get_numbers_of_their_own(build, training_frames):
    first, second = build(training_frames[0]), build(training_frames[1])
    joined = join_datasets([first, second])
    assert len(joined) == len(first) + len(second)
    assert len(np.unique(joined.experiment)) == 2
    assert joined.sources == ('left', 'right')


def test_data_sets_of_different_time_steps_do_not_join(build, unseen_frames):
    first = build(unseen_frames)
    with pytest.raises(InputError, match='differ in time_step'):
        join_datasets([first, dataclasses.replace(first, time_step=60.0)])


def test_fingerprint_changes_with_any_number(build, unseen_frames):
    dataset = build(unseen_frames)
    residual = dataset.residual.copy()
    residual[3, 4, 5] += 1e-6
    assert dataclasses.replace(dataset, residual=residual).fingerprint != dataset.fingerprint


@pytest.mark.parametrize(
    ('content', 'complaint'),
    [
        (b'\x80\x04\x95', 'a pickle'),
        (b'PK\x03\x04rest', 'a pickle'),
        (b'not at all', 'not a safetensors file'),
        (b'', 'not a safetensors file'),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path, content, complaint):
    path = tmp_path / 'pairs.safetensors'
    path.write_bytes(content)
    with pytest.raises(InputError, match=complaint) as refusal:
        load_dataset(path)
    assert '\n' not in str(refusal.value)


def test_missing_file_and_empty_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match='cannot be read'):
        load_dataset(tmp_path / 'none.safetensors')
    with pytest.raises(InputError, match=r'no part_\*'):
        load_dataset(tmp_path)


def test_data_sets_of_different_physics_do_not_join(build, rig, grid, unseen_frames):
    upwind = empty_dataset(rig, grid, 30.0, 'upwind')
    with pytest.raises(InputError, match="physics: preset 'upwind', not 'fast'"):
        join_datasets([upwind, empty_dataset(rig, grid, 30.0, 'fast')])
    other = rig.model_copy(update={'porosity': 0.4})
    with pytest.raises(InputError, match=r'physics: rig .* boundaries or effects'):
        join_datasets([upwind, empty_dataset(other, grid, 30.0, 'upwind')])
    assert join_datasets([upwind, upwind]).physics.known
    # a file of version 0.1 does not name its physics: the joined data set cannot either
    old = dataclasses.replace(build(unseen_frames), physics=PhysicsId())
    assert not join_datasets([upwind, old]).physics.known


def test_file_keeps_the_identity_of_the_physics(rig, grid, tmp_path):
    upwind = empty_dataset(rig, grid, 30.0, 'upwind')
    upwind.save(tmp_path / 'pairs.safetensors')
    assert load_dataset(tmp_path / 'pairs.safetensors').physics == PhysicsId.of(rig, 'upwind')


def test_file_of_version_0_1_is_read_with_an_even_depth(build, unseen_frames, tmp_path):
    dataset = build(unseen_frames)
    header, tensors = dataset.header(), dataset.tensors()
    del header['physics'], tensors['relative_depth']
    path = tmp_path / 'pairs.safetensors'
    write_tensors(path, tensors, FORMAT, {**header, 'dropped': {}, 'sources': []})
    old = load_dataset(path)
    assert old.physics == PhysicsId()
    assert (old.relative_depth == 1.0).all()
    assert np.array_equal(old.residual, dataset.residual)
