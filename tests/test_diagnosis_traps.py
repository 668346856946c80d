"""Traps that would fool a diagnosis, and that they do not fool this one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_examples import SMALL, candidate, fitted, recorded, sample_of, schedule
from scipy.ndimage import gaussian_filter, laplace

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, read_sample
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.search.levels import make_levels
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate

DIFFUSION = 2e-8
"""Diffusion coefficient of the spreading tracer [m^2/s]."""

SPREADING = EffectDescription(
    name='dispersion',
    parameters={
        'longitudinal_dispersivity': 0.0,
        'transverse_dispersivity': 0.0,
        'diffusion': DIFFUSION,
    },
)


@pytest.fixture(scope='module')
def spreading():
    """Maps of a diffusing tracer with 2 % of noise, made by the fine model itself.

    The inverse crime is deliberate: even then noise alone misleads a one-step residual.
    """
    grid, times = SMALL.grid(94, 56), np.arange(0.0, 2701.0, 90.0)
    clean = simulate(SMALL, schedule(), times, grid=grid, effects=(SPREADING,))
    noise = 0.02 * np.random.default_rng(4).standard_normal(clean.shape)
    maps = np.clip(clean + noise, 0, 1).astype(np.float32)
    stored = ConcentrationMaps(times, grid, lambda start, stop: maps[start:stop])
    return Recording(SMALL, schedule(), maps=stored, source=Path('spreading'))


def coarse_fitter(*recordings):
    samples = [sample_of(recording) for recording in recordings]
    return Fitter([Forward(sample, point_spread_width=0.3) for sample in samples])


def one_step_diffusion(recording):
    """Return the least-squares fit of the one-step residual to dt Laplace(c)."""
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
    free = fitted(fitter, 'dispersion diffusion').effects[0].parameters['diffusion']
    naive = one_step_diffusion(spreading)
    assert free == pytest.approx(DIFFUSION, rel=0.4)
    assert naive - DIFFUSION > 3 * abs(free - DIFFUSION)


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
def test_an_effect_of_the_camera_does_not_pass_as_physics(tmp_path, effect, impostor):
    fitter = coarse_fitter(recorded(tmp_path / 'recording', effect))
    camera, physics = fitted(fitter, effect.name), fitted(fitter, impostor)
    assert camera.held_out_misfit < 0.75 * physics.held_out_misfit


def test_a_tenth_of_a_cell_is_no_gap_but_two_percent_of_retardation_is(tmp_path):
    """On the cells of the recording the scheme displaces fronts by more than that."""
    sample = sample_of(recorded(tmp_path / 'recording', grid=SMALL.grid(94, 56)))
    fine = Forward(sample, refinement=2)
    shift = {'dx': 0.1 * sample.grid.dx, 'dz': 0.0, 'rotation': 0.0, 'scale': 1.0}
    changes = []
    for name, parameters in (
        ('registration', shift),
        ('retardation', {'retardation_factor': 1.02}),
    ):
        effect = EffectDescription(name=name, parameters=parameters)
        change = sample.whitened(fine.maps((effect,))) - sample.whitened(fine.maps(()))
        changes.append(np.sqrt(np.sum(change**2) / sample.tracer_cells))
    assert changes[0] < 0.5
    assert changes[1] > max(0.7, 1.5 * changes[0])
    on_own_cells, on_fine_cells = (
        Fitter([replace(forward, point_spread_width=0.55)]).evaluate((), np.zeros(0))
        for forward in (Forward(sample), fine)
    )
    assert on_fine_cells.held_out_misfit < 1.2
    assert on_own_cells.held_out_misfit > 1.3 * on_fine_cells.held_out_misfit


def test_the_point_spread_of_a_camera_is_not_taken_for_diffusion(quiet):
    sample = sample_of(quiet)
    blurred = np.stack([gaussian_filter(frame, 0.6) for frame in sample.observed])
    sample = replace(sample, observed=blurred)
    forward = Forward(sample, refinement=2)
    levels = make_levels([sample], progress=lambda _stage, _share: None)
    measured = levels.with_point_spread_of(levels.null()).judging.forwards[0].point_spread_width
    found = []
    for width in (0.0, measured):
        fit = fitted(Fitter([replace(forward, point_spread_width=width)]), 'dispersion diffusion')
        found.append(fit.effects[0].parameters['diffusion'])
    assert found[1] < 0.2 * found[0]


def test_a_restart_from_every_map_hides_most_of_a_gap(denser_sand):
    """Compared are a free run and one step from a recorded map, both with a wrong porosity."""
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
    observed = recording.concentration[last]
    errors = [
        np.linalg.norm(predicted - observed) / np.linalg.norm(observed)
        for predicted in (free, stepped)
    ]
    assert errors[1] < 0.5 * errors[0]


def test_a_wrong_pair_that_adapts_to_the_fitted_part_fails_in_the_held_out_one(tmp_path):
    """Decay with a refitted porosity imitates a drifting light in the fitted part only."""
    light = EffectDescription(name='illumination', parameters={'drift': -1.2e-4, 'gradient': 0.0})
    fitter = coarse_fitter(recorded(tmp_path / 'recording', light))
    null = fitter.evaluate((), np.zeros(0))
    wrong = fitter.fit([candidate(fitter.samples, name) for name in ('decay', 'porosity')])
    right = fitted(fitter, 'illumination')
    assert wrong.fitted_misfit < 0.6 * null.fitted_misfit
    assert wrong.held_out_misfit > 1.5 * right.held_out_misfit


def test_pixels_are_not_independent_observations(quiet):
    """The standard deviation of a parameter far exceeds the one of independent pixels."""
    fitter = coarse_fitter(quiet)
    fit = fitter.with_covariance(fitted(fitter, 'porosity', coarse_steps=0))
    (residual,) = fitter.residuals(fit.effects, SMOOTHING_WIDTH, fitted_only=True)
    (response,) = fitter.responses(fit.members, fit.scaled_parameters)
    column = response[0][: fitter.samples[0].fitted_frames]
    naive = np.sqrt(np.mean(residual**2) / np.sum(column**2))
    assert np.sqrt(fit.covariance[0, 0]) > 3 * naive


def test_an_effect_has_one_size_in_all_recordings(denser_sand, quiet):
    both, alone = coarse_fitter(denser_sand, denser_sand), coarse_fitter(denser_sand)
    found = fitted(both, 'porosity')
    assert np.allclose(
        found.scaled_parameters, fitted(alone, 'porosity').scaled_parameters, atol=0.05
    )
    contradictory = fitted(coarse_fitter(denser_sand, quiet), 'porosity')
    assert contradictory.held_out_misfit > 2 * found.held_out_misfit


def test_unseen_cells_do_not_count(denser_sand):
    sample = sample_of(denser_sand)
    observed = sample.observed.copy()
    observed[:, 20:26, 20:30] = np.nan
    fits = [
        fitted(Fitter([Forward(each, point_spread_width=0.3)]), 'porosity')
        for each in (sample, replace(sample, observed=observed))
    ]
    assert fits[1].scaled_parameters[0] == pytest.approx(fits[0].scaled_parameters[0], abs=0.4)
    assert np.isfinite(fits[1].held_out_misfit)
