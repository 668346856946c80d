"""Fits: free-running, to the first part, judged on the last."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import recorded

from porotwin_core.errors import InputError
from porotwin_core.rig import Boundaries, EffectDescription
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.model.candidate import Candidate, FitParameter, library, pumping_wells
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import ROUGHNESS, Forward, on_rough_sand
from porotwin_diagnosis.search.ranking import possible
from porotwin_recording.recording import open_recording


@pytest.fixture(scope='module')
def fitter(denser_sand):
    return Fitter([Forward(read_sample(open_recording(denser_sand)))], point_spread_width=0.3)


def candidate(fitter, label):
    return next(c for c in library(fitter.samples) if c.label == label)


def test_knob_turns_and_values_are_inverse():
    for parameter in (
        FitParameter('a', 'm', 2.0, 0.3),
        FitParameter('b', '-', 2.0, 0.3, low=0.1, log=True),
    ):
        assert parameter.value(parameter.scaled(3.7)) == pytest.approx(3.7)
    assert FitParameter('c', '-', 1.0, 0.1, low=1.0).value(-5.0) == 1.0


def test_porosity_is_found_in_data_of_another_simulator(fitter):
    fit = fitter.fit((candidate(fitter, 'porosity'),))
    null = fitter.evaluate((), np.zeros(0))
    assert fit.effects[0].parameters['factor'] == pytest.approx(0.88, abs=0.012)
    assert fit.held_out_misfit < 0.45 * null.held_out_misfit
    fit = fitter.with_covariance(fit)
    assert 0 < np.sqrt(fit.covariance[0, 0]) * 0.015 < 0.02


def test_held_out_frames_take_no_part_in_the_fit(fitter, denser_sand):
    sample = read_sample(open_recording(denser_sand))
    sample.observed[sample.fitted_frames :] = 0.5
    spoiled = Fitter([Forward(sample)], point_spread_width=0.3)
    a = fitter.fit((candidate(fitter, 'porosity'),))
    b = spoiled.fit((candidate(spoiled, 'porosity'),))
    assert np.allclose(a.scaled, b.scaled)
    assert b.held_out_misfit > 3 * a.held_out_misfit


def test_retardation_and_porosity_are_one_product_for_the_camera(fitter):
    slow = EffectDescription(name='retardation', parameters={'retardation_factor': 1.1})
    porous = EffectDescription(name='porosity', parameters={'factor': 1.1})
    maps = [fitter.forwards[0].maps((effect,)) for effect in (slow, porous)]
    assert np.abs(maps[0] - maps[1]).max() < 1e-3


def test_predictions_of_different_effects_lie_apart(fitter):
    right = fitter.fit((candidate(fitter, 'porosity'),))
    wrong = fitter.fit((candidate(fitter, 'saturation'),))
    assert fitter.distance(right, wrong) > 0.5
    assert fitter.distance(wrong, right) == pytest.approx(fitter.distance(right, wrong))
    assert fitter.distance(right, right) == 0.0


def test_model_without_effect_leaves_only_noise_of_a_quiet_recording(quiet):
    sample = read_sample(open_recording(quiet))
    judge = Fitter([Forward(sample, refinement=2)], point_spread_width=0.55)
    null = judge.evaluate((), np.zeros(0))
    assert null.fitted_misfit < 1.2
    assert null.held_out_misfit < 1.2


def test_a_closed_rig_cannot_leak_nor_misdeliver(fitter):
    closed = Boundaries(top='closed')
    sample = replace(
        fitter.samples[0], rig=fitter.samples[0].rig.model_copy(update={'boundaries': closed})
    )
    effects = {candidate.effect for candidate in library([sample])}
    assert effects.isdisjoint({'leak', 'rate'})
    assert 'heterogeneity' in effects


def test_a_judged_fit_is_polished_with_the_slopes_of_coarser_cells(fitter, denser_sand):
    sample = read_sample(open_recording(denser_sand))
    judge = Fitter([Forward(sample, refinement=2)], point_spread_width=0.55)
    porosity = candidate(fitter, 'porosity')
    off = judge.evaluate((porosity,), np.array([porosity.parameters[0].scaled(0.93)]))
    polished = judge.polish(off, fitter)
    assert polished.fitted_misfit < 0.4 * off.fitted_misfit
    assert polished.effects[0].parameters['factor'] == pytest.approx(0.88, abs=0.01)


def test_a_shifted_and_turned_picture_is_found_in_its_narrow_valley(tmp_path):
    truth = {'dx': 0.006, 'dz': -0.008, 'rotation': -0.02, 'scale': 1.01}
    effect = EffectDescription(name='registration', parameters=truth)
    sample = read_sample(open_recording(recorded(tmp_path / 'recording', effect)))
    fitter = Fitter([Forward(sample)], point_spread_width=0.3)
    registration = candidate(fitter, 'registration')
    true = fitter.evaluate(
        (registration,),
        np.array(
            [parameter.scaled(truth[parameter.name]) for parameter in registration.parameters]
        ),
    )
    assert fitter.fit((registration,)).fitted <= 1.01 * true.fitted_misfit


def test_a_true_model_leaves_little_beyond_the_noise_and_a_wrong_one_much(fitter, denser_sand):
    sample = read_sample(open_recording(denser_sand))
    judge = Fitter([Forward(sample, refinement=2)], point_spread_width=0.55)
    right = judge.evaluate((candidate(fitter, 'porosity'),), fitter_turns(fitter, 0.88))
    wrong = judge.evaluate((candidate(fitter, 'porosity'),), fitter_turns(fitter, 0.92))
    left, noise = np.hypot(right.fitted_misfit, right.held_out_misfit), np.hypot(*right.noise)
    assert left < 2.5 * noise
    assert np.hypot(wrong.fitted_misfit, wrong.held_out_misfit) > 2 * left


def fitter_turns(fitter, factor):
    return np.array([candidate(fitter, 'porosity').parameters[0].scaled(factor)])


class Arctangent(Fitter):
    """A fit of a number whose slope vanishes far from the optimum at zero."""

    def residuals(self, effects, width, *, fitted_only=False):
        return [np.arctan([[[float(effects[0].parameters['value'])]]])]


def test_a_fit_that_starts_where_nothing_changes_takes_shorter_steps_until_one_helps():
    parameter = FitParameter('value', '-', 0.0, 1.0)
    scaled = Arctangent([])._descend(
        (Candidate('decay', (parameter,)),), [parameter], np.array([10.0]), 1.5, steps=8
    )
    assert abs(scaled[0]) < 0.5


class Refusing(Arctangent):
    """The same with a model that cannot run below minus one."""

    def residuals(self, effects, width, *, fitted_only=False):
        if float(effects[0].parameters['value']) < -1.0:
            raise InputError('value: must be at least -1')
        return super().residuals(effects, width)


def test_a_step_to_where_the_model_cannot_run_is_not_taken():
    parameter = FitParameter('value', '-', 0.0, 1.0)
    scaled = Refusing([])._descend(
        (Candidate('decay', (parameter,)),), [parameter], np.array([10.0]), 1.5, steps=8
    )
    assert abs(scaled[0]) < 0.5


def test_a_well_beside_a_wall_may_stay_where_it_is(fitter):
    sample = fitter.samples[0]
    well = sample.rig.wells['injector']
    high = well.model_copy(update={'z_m': sample.rig.height_m - 0.5 * well.radius_m})
    rig = sample.rig.model_copy(update={'wells': {**sample.rig.wells, 'injector': high}})
    shifts = next(
        c for c in library([replace(sample, rig=rig)]) if c.label == 'well_position injector'
    )
    assert shifts.parameters[1].range == (pytest.approx(shifts.parameters[1].range[0]), 0.0)
    assert shifts.described((0.0, 0.0)).parameters['dz'] == 0.0


def test_a_well_that_is_listed_but_rests_hides_no_leak(fitter):
    sample = fitter.samples[0]
    rest = ScheduleRow(0.0, 'control3', WellRate(0.0, 0.0))
    resting = replace(sample, schedule=Schedule((*sample.schedule.rows, rest)))
    assert 'control3' not in pumping_wells([resting])


def test_the_slopes_of_later_knobs_are_those_of_all(fitter):
    members = (candidate(fitter, 'porosity'), candidate(fitter, 'saturation'))
    scaled = np.array([-8.0, 0.5])
    every = fitter.responses(members, scaled)[0]
    later = fitter.responses(members, scaled, first=1)[0]
    assert len(later) == 1
    np.testing.assert_array_equal(every[1:], later)


def test_what_is_absent_changes_nothing_and_is_not_simulated(fitter):
    forward = fitter.forwards[0]
    without = forward.maps(())
    absent = []
    for candidate in library(fitter.samples):
        neutral = (0.0,) * len(candidate.parameters)
        if candidate.is_absent(neutral):
            absent.append(candidate)
            np.testing.assert_array_equal(forward.maps((candidate.described(neutral),)), without)
    assert {'porosity', 'clock', 'rate', 'buoyancy'} < {candidate.effect for candidate in absent}
    porous = next(candidate for candidate in absent if candidate.effect == 'porosity')
    fitter.responses((porous,), np.zeros(1))
    before = forward.runs
    other = next(candidate for candidate in absent if candidate.effect == 'depth')
    fitter.responses((porous, other), np.zeros(2), first=1)
    assert forward.runs == before + 1


def test_an_effect_with_which_the_model_cannot_run_is_set_aside(fitter, monkeypatch):
    """A solver that gives up beyond some strength ends neither a fit nor its derivatives."""
    forward, limit = fitter.forwards[0], -2.0
    run = forward.maps

    def refusing(effects, **options):
        for effect in effects:
            if effect.name == 'porosity' and effect.parameters['factor'] < np.exp(0.015 * limit):
                raise InputError('porosity: too dense to run')
        return run(effects, **options)

    monkeypatch.setattr(forward, 'maps', refusing)
    dense = candidate(fitter, 'porosity')
    stopped = fitter.fit((dense,))
    assert stopped.is_feasible
    assert limit <= stopped.scaled[0] < 0.0, 'as far as the model goes'
    assert not fitter.fit((dense,), start=np.array([limit - 1.0])).is_feasible
    at_the_limit = fitter.evaluate((dense,), np.array([limit]))
    assert fitter.polish(at_the_limit, fitter).is_feasible
    screened = [at_the_limit, fitter.evaluate((dense,), np.array([limit - 1.0]))]
    assert possible(screened) == [at_the_limit]


def test_a_thinner_tracer_magnifies_what_nobody_knows_of_the_sand(fitter):
    sample = fitter.samples[0]
    rough = [[Forward(on_rough_sand(sample, seed))] for seed in (0, 1)]
    judge = Fitter([Forward(sample)], point_spread_width=0.3, rough=rough)
    viscosity = candidate(fitter, 'viscosity')

    def fingering_amplification(ratio):
        scaled = np.array([viscosity.parameters[0].scaled(ratio)])
        return judge.evaluate((viscosity,), scaled).fingering_amplification

    assert fingering_amplification(1.5) == (1.0, 1.0)
    thin, thinner = fingering_amplification(0.8), fingering_amplification(0.5)
    assert 1.0 <= thin[1] < thinner[1]


def test_rough_sand_is_the_same_for_the_same_seed_and_as_permeable_on_the_whole(fitter):
    sample = fitter.samples[0]
    one, same, other = (
        on_rough_sand(sample, seed).rig.nominal_map('permeability_m2') for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)
    ratio = np.log(one / sample.rig.field('permeability_m2', sample.grid.refined(2)))
    assert ratio.std() == pytest.approx(ROUGHNESS, rel=0.05)
    assert abs(ratio.mean()) < 0.003
