"""The sample of a recording: selected frames, weights, and where the model starts."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import recorded, with_frames
from scipy.ndimage import gaussian_filter

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.data.misfit import misfit
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, STATED_SHARE, coarsened, read_sample
from porotwin_diagnosis.model.forward import Forward
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.concentration import MapSeries


def test_a_short_recording_is_refused(tmp_path):
    recording = open_recording(recorded(tmp_path / 'short', duration=450))
    with pytest.raises(InputError, match='too few'):
        read_sample(recording)


def test_maps_of_one_column_are_refused(quiet):
    recording = open_recording(quiet)
    narrow = recording.rig.grid(1, 40)
    maps = replace(recording.maps, grid=narrow)
    with pytest.raises(InputError, match='maps of 1 x 40 cells are too coarse'):
        read_sample(replace(recording, maps=maps))


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
    coarse = coarsened(sample, 2)
    assert np.nanmean(np.abs(Forward(coarse).maps(()) - coarse.observed[1])) < 0.01
    assert read_sample(recording).initial is None


def test_a_late_clock_is_not_taken_for_tracer_of_an_earlier_run(quiet):
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    late = with_frames(recording, np.array(recording.times[:-3]), maps[3:])
    assert late.times[0] == 0.0
    assert read_sample(late).initial is None


def test_a_recording_from_the_middle_of_an_injection_starts_with_its_tracer(quiet):
    recording = open_recording(quiet)
    times, maps = np.array(recording.times), np.array(recording.concentration)
    later = [
        ScheduleRow(max(row.time - times[12], 0.0), row.well, row.rate)
        for row in recording.schedule.rows
    ]
    middle = with_frames(recording, times[12:] - times[12], maps[12:])
    sample = read_sample(replace(middle, commanded=Schedule(tuple(later))))
    assert sample.initial is not None
    assert np.nanmean(np.abs(Forward(sample).maps(()) - sample.observed)) < 0.02


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


def told_deviations(recording, deviation, systematic):
    """Return `recording` with the same two deviations in all cells of its maps."""
    maps = recording.maps

    def everywhere(value):
        return MapSeries(maps.times, maps.grid, lambda a, b: np.full_like(maps.read(a, b), value))

    told = replace(maps, deviation=everywhere(deviation), systematic=everywhere(systematic))
    return replace(recording, maps=told)


def test_random_deviations_that_were_delivered_bound_the_noise(quiet):
    recording = open_recording(quiet)
    plain, honest = (read_sample(r) for r in (recording, told_deviations(recording, 0.05, 0.0)))
    one, other = (sample.weight(SMOOTHING_WIDTH) for sample in (plain, honest))
    assert (other <= one).all()
    assert other.max() < 1 / 0.05
    deviations = [
        np.sqrt(sample.expected_noise_squares[weight > 0]) / weight[weight > 0]
        for sample, weight in ((plain, one), (honest, other))
    ]
    assert (deviations[1] >= 0.999 * deviations[0]).all()
    assert deviations[1].min() == pytest.approx(STATED_SHARE * 0.05, rel=0.01)


def test_a_wrong_scale_that_was_delivered_is_no_gap(quiet):
    """The scale of all maps is off by more than the level of the stock may be."""
    recording = open_recording(quiet)
    maps = np.clip(np.array(recording.concentration), 0, 1)
    for systematic in (0.0, 0.2):
        sample = read_sample(told_deviations(recording, 0.2, systematic))
        assert sample.noise.systematic[10] == pytest.approx(systematic, abs=1e-6)
        shown = sample.noise.expected(np.clip(0.8 * sample.observed_or_zero, 0, 1))
        misfits = np.hypot(*misfit([sample], [sample.whitened(shown)]))
        assert misfits > 0.5 if systematic == 0.0 else misfits < 0.45
    assert maps.max() > 0.9


def test_fitted_frames_share_errors_of_their_own(quiet):
    sample = read_sample(told_deviations(open_recording(quiet), 0.05, 0.04))
    count = sample.fitted_frames
    shown = 0.9 * sample.observed_or_zero
    assert sample.whitened(shown[:count]).shape[0] == count
    assert sample.whitened(shown).shape[0] == len(sample.times)
    coarse = coarsened(sample, 2)
    assert np.isfinite(coarse.whitened(0.9 * coarse.observed_or_zero)).all()
