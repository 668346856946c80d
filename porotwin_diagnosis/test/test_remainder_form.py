"""The form of a remainder in the words of a physicist."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import ELEMENT_M, recorded, sample_of
from scipy.ndimage import shift

from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.causes_of_the_camera import causes_of_the_camera
from porotwin_diagnosis.advice.causes_over_time import causes_over_time
from porotwin_diagnosis.advice.free_runs import FreeRuns
from porotwin_diagnosis.advice.remainder_form import describe_remainder
from porotwin_diagnosis.data.sample import coarsened
from porotwin_diagnosis.model.forward import Forward

INJECTOR = (0.235, 0.235)

CASES = {
    'source': (
        EffectDescription(
            name='pump_drift', parameters={'well': 'injector', 'drift': -0.25 / 3000.0}
        ),
        'rate injector, growing',
        'less than commanded at the end',
    ),
    'transport': (
        EffectDescription(
            name='anisotropy', parameters={'z_low': 0.0, 'z_high': 0.562, 'ratio': 1.6}
        ),
        'preferred direction',
        'times better across than up',
    ),
    'camera': (
        EffectDescription(name='stain', parameters={'delay': 300.0}),
        'lagging signal',
        'follows the tracer with a delay of',
    ),
}


def form_of(sample):
    return describe_remainder(Forward(sample, refinement=1))


def coarse(recording):
    """Return a sample on cells of 3 cm: hundreds of runs are quick there."""
    return coarsened(sample_of(recording), 3)


def on_coarse_elements(folder, effect):
    """Write a recording whose elements are about as large as the cells of its maps."""
    return recorded(folder, effect, cell=2.0 * ELEMENT_M)


@pytest.mark.slow
@pytest.mark.parametrize('kind', CASES)
def test_causes_outside_the_library_are_described(kind, tmp_path):
    effect, name, words = CASES[kind]
    form = form_of(coarse(on_coarse_elements(tmp_path, effect)))
    assert form.kind == kind
    assert form.terms[0].name == name
    assert words in form.terms[0].words
    assert form.closed > 0.4
    if kind == 'source':
        assert form.terms[0].place == pytest.approx(INJECTOR)
        assert form.terms[0].amount == pytest.approx(-0.25, rel=0.3)


@pytest.mark.slow
def test_a_glow_is_followed(tmp_path):
    glow = {'x': 0.5, 'z': 0.3, 'radius': 0.04, 'strength': 0.6, 'climb': 0.1 / 3000.0}
    recording = on_coarse_elements(tmp_path, EffectDescription(name='reflection', parameters=glow))
    form = form_of(coarse(recording))
    assert (form.kind, form.terms[0].name) == ('camera', 'moving glow')
    assert form.terms[0].place == pytest.approx((0.5, 0.35), abs=0.03)


def test_a_remainder_without_a_form_is_refused(quiet):
    """Every frame is displaced in its own way."""
    sample = coarse(quiet)
    jumps = np.random.default_rng(2).normal(0.0, 1.5, (len(sample.times), 2))
    jumping = np.stack(
        [shift(frame, jump, order=1) for frame, jump in zip(sample.observed, jumps, strict=True)]
    )
    form = form_of(replace(sample, observed=jumping))
    assert form.terms == ()
    assert form.kind is None
    unseen = replace(sample, observed=np.full_like(sample.observed, np.nan))
    assert form_of(unseen).terms == ()


def test_words_give_times_of_a_recording_that_begins_in_the_middle(quiet):
    sample = coarse(quiet)
    began = float(sample.times[0])
    later = replace(sample, initial=sample.observed_or_zero[0], start=began + 1200.0)
    runs = FreeRuns(Forward(replace(later, end=began + 4800.0), refinement=1))
    pump = next(cause for cause in causes_over_time(runs) if cause.name.endswith('swinging'))
    quarter = 0.25 * 0.35 * 3600.0  # of the shortest period
    assert f'at {(began + 1200.0 + quarter) / 60:.0f} min' in pump.words([0.5, 0.0])


def test_a_run_that_changes_too_late_is_the_usual_run_also_in_a_slow_rig(quiet):
    sample = coarse(quiet)
    slow = Schedule(
        tuple(
            replace(row, time=50.0 * row.time, rate=replace(row.rate, rate=0.02 * row.rate.rate))
            for row in sample.schedule.rows
        )
    )
    sample = replace(sample, schedule=slow, times=50.0 * sample.times, end=50.0 * sample.end)
    runs = FreeRuns(Forward(sample, refinement=1))
    late = (2.0 * sample.end, 3.0 * sample.end)
    (maps,) = runs.changed_within([late], lambda physics: replace(physics, decay_rate=1.0))
    np.testing.assert_allclose(maps, runs.maps, atol=1e-6)


def test_no_form_of_the_camera_is_physically_impossible(quiet):
    runs = FreeRuns(Forward(coarse(quiet), refinement=1))
    causes = {cause.name: cause for cause in causes_of_the_camera(runs)}
    height = runs.sample.grid.height
    upward = causes['paler upward']
    assert (
        upward.words([-0.5 / height]) == 'the plume is 40.0 % paler at the top than at the bottom'
    )
    assert upward.words([0.5 / height]).endswith('paler at the bottom than at the top')
    assert upward.allows([-0.9 / height])
    assert not upward.allows([-1.1 / height])
    assert not causes['lagging signal'].allows([1.1]), 'the concentration would be negative'
    assert not causes['glow'].allows([-1.1]), 'it would be paler than no tracer'
    assert not causes['creeping picture'].allows([runs.sample.grid.width, 0.0])
    assert not causes['wrong speed of the clock'].allows([2.0 * runs.duration])
