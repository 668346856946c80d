"""The sample of a recording: selected frames, weights, and where the model starts."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import recorded, with_frames
from scipy.ndimage import gaussian_filter

from porotwin_core.errors import InputError
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, coarsened, read_sample
from porotwin_diagnosis.model.forward import Forward
from porotwin_recording.concentration import MapSeries
from porotwin_recording.recording import open_recording


def test_a_short_recording_is_refused(tmp_path):
    recording = open_recording(recorded(tmp_path / 'short', duration=450))
    with pytest.raises(InputError, match='too few'):
        read_sample(recording)


def test_a_recording_whose_tracer_comes_late_is_refused(quiet):
    recording = open_recording(quiet)
    late = np.concatenate([[0.0], recording.times[-9:]])
    maps = np.stack([recording.concentration[0], *recording.concentration[-9:]])
    with pytest.raises(InputError, match='no tracer in its first 70 %'):
        read_sample(with_frames(recording, late, maps))


def test_the_model_starts_with_the_tracer_of_the_first_map(quiet):
    """After the plume has come to rest, all maps are the same and no pump runs."""
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    resting_plume = np.repeat(maps[-1:], 20, axis=0)
    times = np.arange(20) * 90.0
    rest = Schedule((ScheduleRow(0.0, 'injector', WellRate(0.0, 0.0)),))
    sample = read_sample(replace(with_frames(recording, times, resting_plume), commanded=rest))
    shown = Forward(sample).maps(())
    assert np.abs(shown - resting_plume[1]).mean() < 0.01
    assert read_sample(recording).initial is None


def test_a_late_clock_is_not_taken_for_tracer_of_an_earlier_run(quiet):
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    late = with_frames(recording, np.array(recording.times[:-8]), maps[8:])
    assert late.times[0] == 0.0
    assert read_sample(late).initial is None


def test_measured_rates_replace_commanded_ones(quiet):
    recording = open_recording(quiet)
    slower = [
        replace(row, rate=replace(row.rate, rate=0.9 * row.rate.rate))
        for row in recording.schedule.rows
    ]
    measured = Schedule(tuple(row for row in slower if row.time > 0))
    sample = read_sample(replace(recording, measured=measured))
    assert sample.schedule.at(0.0) == recording.schedule.at(0.0)
    last = sample.schedule.at(2000.0)['injector'].rate
    assert last == pytest.approx(0.9 * recording.schedule.at(2000.0)['injector'].rate)


def test_weights_of_a_changed_sample_are_its_own(quiet):
    sample = read_sample(open_recording(quiet))
    weight = sample.weight(SMOOTHING_WIDTH)
    noisy = replace(sample, noise=replace(sample.noise, grain=5 * sample.noise.grain))
    assert noisy.weight(SMOOTHING_WIDTH).max() <= weight.max()
    assert not np.array_equal(noisy.weight(SMOOTHING_WIDTH), weight)


def test_a_coarse_sample_holds_the_same_tracer(quiet):
    sample = read_sample(open_recording(quiet))
    coarse = coarsened(sample, 2)
    assert coarse.grid.nx == sample.grid.nx // 2
    np.testing.assert_allclose(
        coarse.observed.mean(axis=(1, 2)), sample.observed.mean(axis=(1, 2)), rtol=1e-12
    )


def test_smoothing_hides_smearing_but_not_a_displaced_front():
    front = 0.5 * (1 - np.tanh((np.arange(200) - 100) / 0.8))
    smeared, moved = gaussian_filter(front, 1.0), np.interp(np.arange(200) - 1.0, range(200), front)
    raw = [np.linalg.norm(front - other) for other in (smeared, moved)]
    smooth = [np.linalg.norm(gaussian_filter(front - other, 1.5)) for other in (smeared, moved)]
    assert smooth[0] / raw[0] < 0.65 * smooth[1] / raw[1]


def test_delivered_deviations_make_a_gap_less_certain(quiet):
    recording = open_recording(quiet)
    plain = read_sample(recording)
    maps = recording.maps
    unsure = MapSeries(maps.times, maps.grid, lambda a, b: np.full_like(maps.read(a, b), 0.05))
    told = replace(recording, maps=replace(maps, deviation=unsure, systematic=unsure))
    honest = read_sample(told)
    assert plain.noise.systematic == ()
    np.testing.assert_allclose(honest.noise.systematic, 0.05, rtol=1e-4)
    one, other = (sample.weight(SMOOTHING_WIDTH) for sample in (plain, honest))
    assert (other <= one).all()
    assert other.max() < 1 / 0.05
    assert honest.expected_noise_squares.max() > plain.expected_noise_squares.max()
