"""The known traps: what would fool a diagnosis, and that it does not fool this one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_examples import SMALL, recorded, schedule
from scipy.ndimage import gaussian_filter, laplace

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.model.candidate import library
from porotwin_diagnosis.model.fit import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.search.levels import Levels
from porotwin_recording.concentration import ConcentrationMaps
from porotwin_recording.recording import Recording, open_recording
from porotwin_solver.model import Model
from porotwin_solver.simulation import simulate

SPREADING = EffectDescription(
    name='dispersion',
    parameters={
        'longitudinal_dispersivity': 0.0,
        'transverse_dispersivity': 0.0,
        'diffusion': 2e-8,
    },
)


@pytest.fixture(scope='module')
def spreading():
    """Maps of a diffusing tracer with 2 % of noise, made by the finer model itself.

    The crime is deliberate: even then a one-step residual is led astray by noise alone.
    """
    grid, times = SMALL.grid(94, 56), np.arange(0.0, 2701.0, 90.0)
    clean = simulate(SMALL, schedule(), times, grid=grid, effects=(SPREADING,))
    noise = 0.02 * np.random.default_rng(4).standard_normal(clean.shape)
    maps = np.clip(clean + noise, 0, 1).astype(np.float32)
    stored = ConcentrationMaps(times, grid, lambda start, stop: maps[start:stop])
    return Recording(Path('spreading'), SMALL, schedule(), maps=stored)


def fitted(fitter, label, **options):
    found = next(c for c in library(fitter.samples) if c.label == label)
    return fitter.fit((found,), **options)


def one_step_diffusion(recording):
    """Least squares of the one-step residual against dt Laplace(c), as one would do naively."""
    grid = recording.grid
    model = Model(recording.rig, grid, preset='fast')
    top = bottom = 0.0
    for before, after in ((10, 11), (12, 13), (14, 15)):
        maps = [recording.concentration[k].astype(float) for k in (before, after)]
        start, end = recording.times[before], recording.times[after]
        predicted = maps[0]
        for low, high, rates in recording.schedule.intervals(start, end):
            predicted = model.predict(predicted, rates, high - low)
        feature = (end - start) * laplace(maps[0]) / grid.dx**2
        top += float(np.sum(feature * (maps[1] - predicted)))
        bottom += float(np.sum(feature**2))
    return top / bottom


def test_free_runs_find_a_diffusion_that_one_step_residuals_miss_in_noise(spreading):
    fitter = Fitter([Forward(read_sample(spreading), refinement=2)])
    fit = fitted(fitter, 'dispersion diffusion')
    free = fit.effects[0].parameters['diffusion']
    naive = one_step_diffusion(spreading)
    assert free == pytest.approx(2e-8, rel=0.4)
    assert naive - 2e-8 > 3 * abs(free - 2e-8)


@pytest.mark.parametrize(
    ('effect', 'impostor'),
    [
        (
            EffectDescription(name='illumination', parameters={'drift': -1.2e-4, 'gradient': 0.0}),
            'decay',
        ),
        (EffectDescription(name='clock', parameters={'offset': 150.0}), 'rate injector'),
        (EffectDescription(name='saturation', parameters={'exponent': 0.4}), 'rate injector'),
        (
            EffectDescription(
                name='registration',
                parameters={'dx': 0.0, 'dz': -0.008, 'rotation': 0.0, 'scale': 1.0},
            ),
            'buoyancy',
        ),
    ],
)
def test_what_the_camera_does_does_not_pass_as_physics(tmp_path, effect, impostor):
    sample = read_sample(open_recording(recorded(tmp_path / 'recording', effect)))
    fitter = Fitter([Forward(sample)], soft=0.3)
    camera, physics = fitted(fitter, effect.name), fitted(fitter, impostor)
    assert camera.held_out < 0.75 * physics.held_out


def test_a_front_a_tenth_of_a_cell_off_is_no_gap_but_two_percent_of_retardation_is(quiet):
    """On the recording's own cells the scheme moves fronts by more than that: a gap by itself."""
    sample = read_sample(open_recording(quiet))
    forward = Forward(sample, refinement=2)
    tenth = 0.1 * sample.grid.dx
    moved = {'dx': tenth, 'dz': 0.0, 'rotation': 0.0, 'scale': 1.0}
    changes = []
    for name, parameters in (
        ('registration', moved),
        ('retardation', {'retardation_factor': 1.02}),
    ):
        effect = EffectDescription(name=name, parameters=parameters)
        change = sample.whitened(forward.maps((effect,))) - sample.whitened(forward.maps(()))
        changes.append(np.sqrt(np.sum(change**2) / sample.active))
    assert changes[0] < 0.5
    assert changes[1] > max(0.7, 1.5 * changes[0])
    own, finer = (
        Fitter([shown], soft=0.55).judged((), np.zeros(0)) for shown in (Forward(sample), forward)
    )
    assert finer.held_out < 1.2
    assert own.held_out > 1.3 * finer.held_out


def test_the_blur_of_a_camera_is_not_diffusion(quiet):
    sample = read_sample(open_recording(quiet))
    soft = np.stack([gaussian_filter(frame, 0.6) for frame in sample.observed])
    blurred = replace(sample, observed=soft, weights={})
    forward = Forward(blurred, refinement=2)
    tuned = Levels([blurred], progress=lambda _stage, _share: None, workers=1)
    tuned.measure_blur(tuned.null())
    found = []
    for width in (0.0, tuned.judging.soft):
        fit = fitted(Fitter([forward], soft=width), 'dispersion diffusion')
        found.append(fit.effects[0].parameters['diffusion'])
    assert found[1] < 0.2 * found[0]


def test_a_restart_from_every_map_hides_most_of_a_gap(denser_sand):
    """What a free run leaves, and what one step from a recorded map leaves, of wrong porosity."""
    recording = open_recording(denser_sand)
    sample = read_sample(recording)
    free = Forward(sample).maps(())[-1]
    model = Model(recording.rig, recording.grid, preset='fast')
    before, last = (
        np.flatnonzero(recording.times <= time)[-1]
        for time in (sample.times[-1] - 90, sample.times[-1])
    )
    stepped = np.asarray(recording.concentration[before], dtype=float)
    for low, high, rates in recording.delivered.intervals(
        recording.times[before], recording.times[last]
    ):
        stepped = model.predict(stepped, rates, high - low)
    seen = recording.concentration[last]
    errors = [np.linalg.norm(shown - seen) / np.linalg.norm(seen) for shown in (free, stepped)]
    assert errors[1] < 0.5 * errors[0]


def test_a_wrong_effect_beside_a_refitted_porosity_fails_in_what_it_has_not_seen(tmp_path):
    """Decay and drifting light: the first with a porosity closes what it is fitted to."""
    light = EffectDescription(name='illumination', parameters={'drift': -1.2e-4, 'gradient': 0.0})
    sample = read_sample(open_recording(recorded(tmp_path / 'recording', light)))
    fitter = Fitter([Forward(sample)], soft=0.3)
    known = {candidate.label: candidate for candidate in library([sample])}
    null = fitter.judged((), np.zeros(0))
    wrong = fitter.fit((known['decay'], known['porosity']))
    right = fitter.fit((known['illumination'],))
    assert wrong.fitted < 0.6 * null.fitted
    assert wrong.held_out > 1.5 * right.held_out


def test_pixels_are_not_samples(quiet):
    """The interval of a parameter is far wider than independent pixels would make it."""
    sample = read_sample(open_recording(quiet))
    fitter = Fitter([Forward(sample)], soft=0.3)
    fit = fitter.with_covariance(fitted(fitter, 'porosity', coarse_steps=0))
    residual = fitter.residuals(fit.effects, 1.5, fitted_only=True)
    column = fitter.responses(fit.members, fit.scaled)[0][0][: sample.fitted]
    naive = np.sqrt(np.mean(residual[0] ** 2) / np.sum(column**2))
    assert np.sqrt(fit.covariance[0, 0]) > 3 * naive


def test_one_effect_has_one_size_in_all_recordings(denser_sand, quiet):
    same = [read_sample(open_recording(denser_sand)) for _ in range(2)]
    both = Fitter([Forward(sample) for sample in same], soft=0.3)
    alone = Fitter([Forward(same[0])], soft=0.3)
    assert np.allclose(fitted(both, 'porosity').scaled, fitted(alone, 'porosity').scaled, atol=0.05)
    torn = Fitter([Forward(same[0]), Forward(read_sample(open_recording(quiet)))], soft=0.3)
    assert fitted(torn, 'porosity').held_out > 2 * fitted(both, 'porosity').held_out


def test_blind_spots_of_the_camera_do_not_count(denser_sand):
    sample = read_sample(open_recording(denser_sand))
    blind = sample.observed.copy()
    blind[:, 20:26, 20:30] = np.nan
    patched = replace(sample, observed=blind, weights={})
    a = fitted(Fitter([Forward(sample)], soft=0.3), 'porosity')
    b = fitted(Fitter([Forward(patched)], soft=0.3), 'porosity')
    assert b.scaled[0] == pytest.approx(a.scaled[0], abs=0.4)
    assert np.isfinite(b.held_out)


def test_smoothing_hides_what_a_scheme_smears_but_not_a_displaced_front():
    front = 0.5 * (1 - np.tanh((np.arange(200) - 100) / 0.8))
    smeared, moved = gaussian_filter(front, 1.0), np.interp(np.arange(200) - 1.0, range(200), front)
    raw = [np.linalg.norm(front - other) for other in (smeared, moved)]
    smooth = [np.linalg.norm(gaussian_filter(front - other, 1.5)) for other in (smeared, moved)]
    assert smooth[0] / raw[0] < 0.65 * smooth[1] / raw[1]
