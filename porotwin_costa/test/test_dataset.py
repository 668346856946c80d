import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.errors import InputError
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, WellRate
from porotwin_costa.dataset import (
    FORMAT,
    Frames,
    build_dataset,
    empty_dataset,
    join_datasets,
    load_dataset,
    mean_rates,
    rate_vector,
)
from porotwin_costa.files import read_header, write_tensors
from porotwin_costa.physics_id import PhysicsId


@pytest.fixture(scope='module')
def build(rig, grid, model):
    def run(*experiments, time_step=30.0):
        return build_dataset(
            experiments,
            rig,
            grid=grid,
            time_step=time_step,
            predict=model.predict,
            residual=model.residual,
        )

    return run


def test_exact_residual_returns_the_observed_state(build, model, unseen_frames):
    dataset = build(unseen_frames)
    for n in range(len(dataset)):
        rates = mean_rates(unseen_frames.schedule, n * 30.0, (n + 1) * 30.0)
        corrected = model.correct(
            unseen_frames.concentration[n], dataset.residual[n].astype(float), rates, 30.0
        )
        # the data set keeps float32: relative 6e-8 of a residual of about phi / dt
        assert np.abs(corrected - unseen_frames.concentration[n + 1]).max() < 1e-6


def test_every_consecutive_pair_becomes_one_sample(build, unseen_frames):
    dataset = build(unseen_frames)
    assert len(dataset) == len(unseen_frames.times) - 1
    assert dataset.predicted.shape == dataset.residual.shape == (24, 20, 30)
    assert np.array_equal(dataset.time, unseen_frames.times[1:])
    assert 'left out' not in dataset.summary


def test_no_pair_reaches_across_a_clean_state(build, unseen_frames):
    dataset = build(dataclasses.replace(unseen_frames, clean_times=(300.0,)))
    assert 300.0 not in dataset.time
    assert len(dataset) == 23
    assert len(np.unique(dataset.experiment)) == 2
    assert '1 pairs across an interruption' in dataset.summary


def test_pairs_of_another_time_step_are_left_out_and_counted(build, unseen_frames):
    keep = np.arange(25) != 7
    frames = dataclasses.replace(
        unseen_frames,
        times=unseen_frames.times[keep],
        concentration=unseen_frames.concentration[keep],
    )
    dataset = build(frames)
    assert len(dataset) == 22
    assert '1 pairs not 30 s apart' in dataset.summary


def _hiding(frames, cells):
    """Return the frames with `cells` (nz, nx) hidden in all of them, as by chart and tubes."""
    concentration = np.where(cells, np.nan, frames.concentration)
    return dataclasses.replace(frames, concentration=concentration)


def test_sand_that_is_never_seen_is_believed_as_predicted(build, model, unseen_frames):
    hidden = np.zeros(model.grid.shape, bool)
    hidden[4:12, 6:9] = True  # the plume passes here
    dataset, whole = build(_hiding(unseen_frames, hidden)), build(unseen_frames)
    assert len(dataset) == len(whole)
    assert 'left out' not in dataset.summary
    assert np.isfinite(dataset.predicted).all()
    assert not dataset.residual[:, hidden].any()
    truth = whole.predicted[-1, hidden]
    assert truth.max() > 0.5
    # 24 steps of the diffusive scheme where nothing corrects it
    assert np.abs(dataset.predicted[-1, hidden] - truth).max() < 0.2
    error = np.linalg.norm(dataset.residual - whole.residual, axis=(1, 2))
    assert error[-1] < np.linalg.norm(whole.residual[-1])


def test_nothing_is_believed_across_a_clean_state(build, model, unseen_frames):
    hidden = np.zeros(model.grid.shape, bool)
    hidden[4:12, 6:9] = True
    frames = dataclasses.replace(_hiding(unseen_frames, hidden), clean_times=(300.0,))
    dataset = build(frames)
    rates = mean_rates(frames.schedule, 300.0, 330.0)
    blank = np.where(hidden, 0.0, unseen_frames.concentration[10])
    after = dataset.predicted[dataset.time == 330.0][0]
    assert np.array_equal(after, model.predict(blank, rates, 30.0).astype(np.float32))


def test_frames_with_too_little_seen_are_left_out_and_counted(build, unseen_frames):
    concentration = unseen_frames.concentration.copy()
    concentration[10, :, 14:] = np.nan
    dataset = build(dataclasses.replace(unseen_frames, concentration=concentration))
    assert len(dataset) == 22
    assert np.isfinite(dataset.predicted).all()
    assert '2 pairs with too little seen' in dataset.summary


def test_nothing_to_learn_from_says_why(build, unseen_frames):
    with pytest.raises(InputError, match='24 pairs not 60 s apart'):
        build(unseen_frames, time_step=60.0)


def test_maps_on_another_grid_are_refused(build, unseen_frames):
    frames = dataclasses.replace(unseen_frames, concentration=np.zeros((25, 8, 9)))
    with pytest.raises(InputError, match=r'\(8, 9\).*30x20'):
        build(frames)


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


def test_joined_experiments_keep_apart(build, training_frames):
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


rates = st.floats(-500, 500).map(lambda rate: WellRate(from_ml_h(rate), 0.5 if rate > 0 else 0.0))


@given(st.lists(st.tuples(st.floats(0, 40), rates), min_size=1, max_size=5))
def test_mean_rates_pump_the_same_volume_and_tracer(changes):
    schedule = Schedule.from_rates([(0.0, {'a': WellRate()}), *((t, {'a': r}) for t, r in changes)])
    mean = mean_rates(schedule, 5.0, 35.0)['a']
    intervals = list(schedule.intervals(5.0, 35.0))
    volume = sum((end - start) * told['a'].rate for start, end, told in intervals)
    assert mean.rate * 30.0 == pytest.approx(volume, abs=1e-15)
    if all(told['a'].rate >= 0 for *_, told in intervals):
        tracer = sum(
            (end - start) * t['a'].rate * t['a'].concentration for start, end, t in intervals
        )
        assert mean.rate * mean.concentration * 30.0 == pytest.approx(tracer, abs=1e-15)


def test_rates_become_a_vector_in_the_order_of_the_wells():
    told = {'b': WellRate(2e-7, 0.5), 'c': WellRate(-1e-7, 1.0)}
    assert rate_vector(told, ('a', 'b', 'c')).tolist() == [[0, 0], [2e-7, 1e-7], [-1e-7, 0]]


def test_a_pumping_well_that_costa_does_not_know_is_refused():
    with pytest.raises(InputError, match=r"'new'.*a, b"):
        rate_vector({'new': WellRate(1e-7)}, ('a', 'b'))
    assert rate_vector({'new': WellRate()}, ('a',)).sum() == 0
    assert isinstance(Frames(np.zeros(1), np.zeros((1, 1, 1)), Schedule()).name, str)


def test_data_sets_of_different_physics_do_not_join(build, rig, grid, unseen_frames):
    upwind = empty_dataset(rig, grid, 30.0, 'upwind')
    with pytest.raises(InputError, match="physics: preset 'upwind', not 'fast'"):
        join_datasets([upwind, empty_dataset(rig, grid, 30.0, 'fast')])
    other = rig.model_copy(update={'porosity': 0.4})
    with pytest.raises(InputError, match=r'physics: rig .* boundaries or effects'):
        join_datasets([upwind, empty_dataset(other, grid, 30.0, 'upwind')])
    assert join_datasets([upwind, upwind]).physics.known
    # one of before this was kept: joined, but nobody can vouch for it
    old = dataclasses.replace(build(unseen_frames), physics=PhysicsId())
    assert not join_datasets([upwind, old]).physics.known


def test_file_keeps_whose_predictions_it_holds(rig, grid, tmp_path):
    upwind = empty_dataset(rig, grid, 30.0, 'upwind')
    upwind.save(tmp_path / 'pairs.safetensors')
    assert load_dataset(tmp_path / 'pairs.safetensors').physics == PhysicsId.of(rig, 'upwind')


def test_older_file_is_read_as_of_a_rig_of_even_depth(build, unseen_frames, tmp_path):
    dataset = build(unseen_frames)
    header, tensors = dataset._header(), dataset._tensors()
    del header['physics'], tensors['relative_depth']
    path = tmp_path / 'pairs.safetensors'
    write_tensors(path, tensors, FORMAT, {**header, 'dropped': {}, 'sources': []})
    old = load_dataset(path)
    assert old.physics == PhysicsId()
    assert (old.relative_depth == 1.0).all()
    assert np.array_equal(old.residual, dataset.residual)


def test_a_sound_file_whose_length_looks_like_a_pickle_is_read(tmp_path):
    for length in range(300):
        path = tmp_path / f'{length}.safetensors'
        write_tensors(path, {'value': np.zeros(1)}, 'test', {'text': 'x' * length})
        assert read_header(path, 'test')['text'] == 'x' * length
    starts = {path.read_bytes()[:1] for path in tmp_path.iterdir()}
    assert b'\x80' in starts
