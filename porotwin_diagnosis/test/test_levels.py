"""The levels of a search, their corrections and their point spread."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import TYPICAL_SEED, candidate, sample_of

from porotwin_core.basis.parallel import crew
from porotwin_core.geometry.grid import relative_error
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.noise import blurred
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.ranking import normalised_misfit, score
from porotwin_diagnosis.thresholds import CORRECTED_MISFIT
from porotwin_rig.map_camera import MapNoise


def levels_of(recording):
    return make_levels([sample_of(recording)], progress=lambda _stage, _share: None)


def corrections(levels):
    return [levels.judging.forwards[0].correction, levels.screening.forwards[0].correction]


def test_the_point_spread_is_measured_with_a_model_that_fits(quiet):
    levels = levels_of(quiet)
    null = levels.null()
    measured = levels.with_point_spread_of(null)
    true = MapNoise.drawn(TYPICAL_SEED).blur_cells
    assert measured.judging.forwards[0].point_spread_width == pytest.approx(true, abs=0.2)
    assert measured.null().fitted_misfit <= null.fitted_misfit + 1e-6


def test_every_recording_has_a_point_spread_of_its_own(quiet):
    sharp = sample_of(quiet)
    blurred_maps = np.stack([blurred(frame[None], 0.6)[0] for frame in sharp.observed_or_zero])
    soft = replace(sharp, observed=np.where(sharp.seen_mask > 0, blurred_maps, np.nan))
    levels = make_levels([sharp, soft], progress=lambda _stage, _share: None)
    measured = levels.with_point_spread_of(levels.null()).judging.forwards
    assert measured[1].point_spread_width > measured[0].point_spread_width + 0.1


def test_a_simulation_on_the_finest_cells_corrects_the_judging_cells(quiet):
    levels = levels_of(quiet)
    before = levels.null()
    corrected = levels.corrected_at(before)
    assert corrected.judging.forwards[0].correction is not None
    assert score(corrected.null()) < score(before)


def test_levels_do_not_change_when_others_are_made_from_them(quiet):
    levels = levels_of(quiet)
    before, width = levels.null(), levels.judging.forwards[0].point_spread_width
    corrected = levels.corrected_at(before)
    levels.with_corrected_coarse_cells(())
    assert corrections(levels) == [None, None]
    assert corrections(corrected)[1] is None
    assert levels.judging.forwards[0].point_spread_width == width
    after = levels.null()
    assert (after.fitted_misfit, after.held_out_misfit) == (
        before.fitted_misfit,
        before.held_out_misfit,
    )


def test_fits_side_by_side_are_the_same_to_the_last_bit(quiet):
    sample = sample_of(quiet)
    starts = [candidate([sample], name) for name in ('porosity', 'retardation', 'decay')]
    found = []
    for workers in (1, 3):
        with crew(workers=workers, threads=True, task_bytes=1.0) as pool:
            levels = make_levels([sample], progress=lambda _stage, _share: None, crew=pool)
            fits = levels.side_by_side(levels.screening.fit, [(start,) for start in starts])
            found.append((fits, levels.simulations))
    assert found[0][1] == found[1][1]
    for one, other in zip(found[0][0], found[1][0], strict=True):
        np.testing.assert_array_equal(one.scaled_parameters, other.scaled_parameters)
        assert one.held_out_misfit == other.held_out_misfit


def test_corrected_coarse_cells_predict_like_the_judging_cells(quiet):
    levels = levels_of(quiet)
    corrected = levels.with_corrected_coarse_cells(())
    fine = corrected.judging.forwards[0].maps(())
    np.testing.assert_allclose(corrected.refining.forwards[0].maps(()), fine, atol=1e-6)


def test_levels_are_not_corrected_at_a_fit_with_a_large_gap(denser_sand):
    levels = levels_of(denser_sand)
    null = levels.null()
    assert normalised_misfit(null) > CORRECTED_MISFIT
    assert levels.corrected_at(null) is levels


def test_no_fits_are_judged_again_without_a_change(quiet):
    levels = levels_of(quiet)
    assert levels.judged_again([], levels.null(), 0.5) == (levels, [])


def test_the_change_by_an_effect_is_measured_on_sharp_fronts(denser_sand):
    """A bent response changes fronts only as far as they are smeared, also by the scheme."""
    levels = levels_of(denser_sand)
    bent = EffectDescription(name='saturation', parameters={'exponent': 0.7})
    coarse = levels.refining.forwards[0]
    begin = coarse.sample.fitted_frames
    smeared = relative_error(coarse.maps((bent,))[begin:], coarse.maps(())[begin:])
    assert 0.0 < levels.relative_change((bent,)) < 0.8 * smeared


def test_a_leak_at_a_pumping_well_is_recognised(quiet):
    levels = levels_of(quiet)
    well = levels.samples[0].rig.wells['injector']
    leak = candidate(levels.samples, 'leak')

    def fit_at(x, z):
        scaled = [leak.parameters[0].scaled(x), leak.parameters[1].scaled(z), 1.0]
        return levels.screening.evaluate((leak,), np.array(scaled))

    assert levels.has_leak_at_well(fit_at(well.x_m + 0.02, well.z_m))
    away = fit_at(0.45, 0.2)
    assert not levels.has_leak_at_well(away)
    assert levels.ranked([fit_at(well.x_m + 0.02, well.z_m), away]) == [away]
