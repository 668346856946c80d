"""The next experiment: what would set two explanations apart, and what would not."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import SMALL, schedule

from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.advice.proposals import SCHEDULES, propose
from porotwin_diagnosis.data.sample import coarsened, read_sample
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.model.fit import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.search.search import Findings
from porotwin_recording.recording import open_recording
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.map_camera import MapNoise


@pytest.fixture(scope='module')
def sample(tmp_path_factory):
    """Tracer from one well alone: a wrong rate of that well looks as a wrong porosity does."""
    folder = tmp_path_factory.mktemp('alone') / 'recording'
    injector = ScheduleRow(0.0, 'injector', WellRate(from_ml_h(450.0), 1.0))
    later = [
        ScheduleRow(2070.0, 'injector', WellRate()),
        ScheduleRow(2070.0, 'control2', WellRate(from_ml_h(300.0))),
    ]
    make_experiment(
        folder,
        SMALL,
        commanded=Schedule((injector, *later)),
        duration=2160,
        photo_interval=90,
        seed=3,
        noise=MapNoise.drawn(3),
        grid=SMALL.grid(94, 56),
    )
    return coarsened(read_sample(open_recording(folder)), 2)


def proposed(sample, one, other):
    """Return the gains of experiments that separate two effects, given as (label, values)."""
    fitter = Fitter([Forward(sample)])
    candidates = {candidate.label: candidate for candidate in library([sample])}
    fits = []
    for label, values in (one, other):
        scaled = [
            parameter.scaled(value)
            for parameter, value in zip(candidates[label].parameters, values, strict=True)
        ]
        fits.append(fitter.judged((candidates[label],), np.array(scaled)))
    null = fitter.judged((), np.zeros(0))
    findings = Findings(null, null, fits, fits, distances=[0.0, 0.1])
    name = fits[0].members[0].effect
    return propose(fitter, findings, Verdict(name, 0.5, fits[0], (name,), (), {}))


def gains(proposals):
    return {proposal.name: proposal.gain for proposal in proposals if proposal.gain is not None}


def test_a_second_well_tells_a_wrong_rate_from_a_wrong_porosity(sample):
    found = proposed(sample, ('rate injector', (0.85,)), ('porosity', (1 / 0.85,)))
    assert [proposal.name for proposal in found] == [
        'check rate',
        'check porosity',
        'one well at a time',
    ]
    gain = gains(found)
    assert gain['one well at a time'] > 2.0
    assert set(gain) == {'one well at a time'}  # nothing else brings the second well in


def test_a_rest_tells_diffusion_from_dispersion(sample):
    gain = gains(proposed(sample, ('dispersion diffusion', (3e-8,)), ('dispersion', (2e-3, 2e-4))))
    assert gain['rest'] == max(gain.values())
    assert gain['rest'] > gain['double rates'] > 1.1


def test_without_a_gap_nothing_is_proposed(sample):
    fitter = Fitter([Forward(sample)])
    null = fitter.judged((), np.zeros(0))
    assert propose(fitter, Findings(null, null, []), Verdict('none', 0.9, null, (), (), {})) == ()


def test_one_well_at_a_time_lets_one_pump_and_keeps_a_closed_rig_in_balance(sample):
    change = next(change for name, _, change in SCHEDULES if name == 'one well at a time')
    both = change(sample).schedule
    for low, _, rates in both.intervals(sample.start, sample.end):
        assert sum(rate.rate != 0.0 for rate in rates.values()) == 1, low
    alone = Schedule(sample.schedule.rows[:1])
    joined = change(replace(sample, schedule=alone)).schedule
    assert joined.wells == ('injector', 'control1')  # the next one
    shut = SMALL.model_copy(
        update={'boundaries': SMALL.boundaries.model_copy(update={'top': 'closed'})}
    )
    forth = [ScheduleRow(t, 'injector', WellRate(rate)) for t, rate in ((0, 2e-7), (60, -1e-7))]
    back = [ScheduleRow(t, 'producer', WellRate(rate)) for t, rate in ((0, -1e-7), (60, 2e-7))]
    to_and_fro = Schedule((*forth, *back))
    assert change(replace(sample, rig=shut, schedule=to_and_fro)) is None, 'nobody produces'
    closed = change(replace(sample, rig=shut, schedule=schedule())).schedule
    for _, _, rates in closed.intervals(sample.start, sample.end):
        assert sum(rate.rate for rate in rates.values()) == pytest.approx(0.0, abs=1e-15)
        assert sum(rate.rate > 0.0 for rate in rates.values()) == 1
