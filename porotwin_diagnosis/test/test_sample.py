"""What counts as evidence of a gap, and what the noise alone would show."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import with_frames
from scipy.ndimage import gaussian_filter

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.data.noise import Noise
from porotwin_diagnosis.data.sample import Sample, misfit, noise_misfit, read_sample
from porotwin_diagnosis.model.forward import Forward
from porotwin_recording.recording import open_recording

NOISE = Noise(0.03, 0.008, 0.004, correlation=0.8)


def discs(level):
    """Discs of tracer (16, 60, 90), each wider than the one before, as pale as `level`."""
    z, x = np.mgrid[:60, :90]
    distance = np.hypot(x - 45, z - 30)
    radius = np.linspace(8.0, 26.0, 16)[:, None, None]
    return level * 0.5 * (1 - np.tanh((distance - radius) / 1.5))


def noisy(maps):
    """`maps` as a camera with `NOISE` would record them."""
    generator = np.random.default_rng(4)

    def correlated():
        field = gaussian_filter(generator.standard_normal(maps[0].shape), NOISE.correlation)
        return field / field.std()

    grain = 1 + NOISE.grain * correlated()
    share = NOISE.background + (NOISE.frame - NOISE.background) * maps
    return np.clip([m * grain + s * correlated() for m, s in zip(maps, share, strict=True)], 0, 1)


def sample_of(maps):
    return Sample(
        rig=None,
        schedule=None,
        grid=Grid(nx=90, nz=60, width=0.45, height=0.3),
        times=np.arange(16.0),
        observed=noisy(maps),
        fitted=10,
        noise=NOISE,
        start=0.0,
        held_out_start=10.0,
        end=16.0,
    )


@pytest.mark.parametrize('level', [0.8, 0.88, 0.9, 0.92, 1.0])
def test_noise_in_a_pale_plume_is_no_gap(level):
    pale = discs(level)
    sample = sample_of(pale)
    residuals = [sample.whitened(pale)]
    left, noise = misfit([sample], residuals), noise_misfit([sample], residuals)
    assert left == pytest.approx(noise, rel=0.15)


def test_a_pale_plume_beside_a_full_prediction_is_a_gap():
    sample = sample_of(discs(0.8))
    residuals = [sample.whitened(discs(1.0))]
    assert min(misfit([sample], residuals)) > 5 * max(noise_misfit([sample], residuals))


def test_a_recording_whose_tracer_comes_late_is_refused_in_one_line(quiet):
    recording = open_recording(quiet)
    late = np.concatenate([[0.0], recording.times[-9:]])
    maps = np.stack([recording.concentration[0], *recording.concentration[-9:]])
    with pytest.raises(InputError, match='no tracer in its first 70 %'):
        read_sample(with_frames(recording, late, maps))


def test_a_model_begins_with_the_tracer_of_the_first_map(quiet):
    """The second half of a recording alone, without pumps, after the plume has come to rest."""
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    still = np.repeat(maps[-1:], 20, axis=0)
    times = np.arange(20) * 90.0
    resting = Schedule(tuple(ScheduleRow(0.0, w, WellRate(0.0, 0.0)) for w in ('injector',)))
    sample = read_sample(replace(with_frames(recording, times, still), told=resting))
    shown = Forward(sample).maps(())
    assert np.abs(shown - still[1]).mean() < 0.01
    assert read_sample(recording).initial is None


def test_a_late_clock_is_not_taken_for_tracer_of_an_earlier_run(quiet):
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    late = with_frames(recording, np.array(recording.times[:-8]), maps[8:])
    assert late.times[0] == 0.0
    assert read_sample(late).initial is None


def test_measured_rates_count_where_there_are_any(quiet):
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
