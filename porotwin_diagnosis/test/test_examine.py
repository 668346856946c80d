"""The diagnosis from a folder to a report, on recordings of an independent simulator."""

import json
from dataclasses import replace

import netCDF4
import numpy as np
import pytest
from diagnosis_examples import BESIDE_THE_POINT, recorded

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription, load_rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.examine import diagnose
from porotwin_diagnosis.model.fit import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.gap_map import _phases, map_gap
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.search.scan import starts
from porotwin_recording.concentration import ConcentrationMaps
from porotwin_recording.recording import open_recording


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_wrong_porosity_is_named_and_the_rig_mended(denser_sand, tmp_path):
    stages = []
    diagnose(
        denser_sand,
        tmp_path / 'out',
        apply=True,
        progress=lambda stage, share: stages.append((stage, share)),
    )
    said = json.loads((tmp_path / 'out' / 'diagnosis.json').read_text())
    assert said['verdict'] == 'porosity'
    assert said['error']['gap_closed'] > 0.8
    assert said['effects'][0]['parameters']['factor']['value'] == pytest.approx(0.88, abs=0.01)
    assert said['where']['centre'] is None
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert page.count('data:image/png;base64,') == 3
    assert 'http' not in page.replace('http-equiv', '')
    with netCDF4.Dataset(tmp_path / 'out' / 'fields.nc') as fields:
        observed = fields['observed'][:]
        after = np.linalg.norm(fields['predicted_after'][:] - observed)
        before = np.linalg.norm(fields['predicted_before'][:] - observed)
        assert fields['gap'].shape == observed.shape[1:]
    assert after < 0.6 * before
    assert after / np.linalg.norm(observed) == pytest.approx(said['error']['after'], rel=0.01)
    mended = load_rig(tmp_path / 'out' / 'rig.yaml')
    assert [effect.name for effect in mended.effects] == ['porosity']
    assert stages[-1] == ('done', 1.0)
    shares = [share for _, share in stages]
    assert shares == sorted(shares)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_diffusive_scheme_is_called_numerical_and_not_dispersion(quiet, tmp_path):
    result = diagnose(quiet, tmp_path / 'out', preset='upwind', excluded=BESIDE_THE_POINT)
    assert result.verdict.name == 'numerical_diffusion'
    assert result.numerics.model_diffusion > 1e-8
    assert result.summary['error']['gap_closed'] > 0.8


def test_gap_arises_at_the_leak_and_not_where_the_flow_carries_it(tmp_path):
    leak = EffectDescription(name='leak', parameters={'x': 0.33, 'z': 0.3, 'rate': -80.0})
    gap = map_gap(open_recording(recorded(tmp_path / 'recording', leak)))
    spots = gap.spots[:2]
    assert min(np.hypot(spot.x - 0.33, spot.z - 0.3) for spot in spots) < 0.1
    assert sum(phase.share for phase in gap.phases) == pytest.approx(1.0, abs=0.01)
    assert {phase.state for phase in gap.phases} <= {'injecting', 'resting', 'chasing'}


def test_a_leak_within_the_plume_is_looked_for_where_it_is(tmp_path):
    """There, water that enters makes a hole, and water that is lost does not."""
    leak = EffectDescription(name='leak', parameters={'x': 0.23, 'z': 0.3, 'rate': -22.0})
    sample = read_sample(open_recording(recorded(tmp_path / 'recording', leak)))
    first = starts([Forward(sample)], 'leak')[0]
    start = first.described(first.first).parameters
    assert np.hypot(float(start['x']) - 0.23, float(start['z']) - 0.3) < 0.06
    assert -40.0 < float(start['rate']) < -10.0


def test_a_leak_is_looked_for_beside_what_may_adapt(tmp_path):
    """A picture that was moved hides where the leak is, and a fit that lacks it imitates both."""
    leak = EffectDescription(name='leak', parameters={'x': 0.16, 'z': 0.3, 'rate': -40.0})
    moved = EffectDescription(name='registration', parameters={'dx': 0.006, 'dz': -0.004})
    sample = read_sample(open_recording(recorded(tmp_path / 'recording', leak, moved)))
    registration = next(c for c in library([sample]) if c.effect == 'registration')
    fitter = Fitter([Forward(sample)])
    imitating = fitter.fit((registration,))
    first = starts(fitter.forwards, 'leak', beside=imitating)[0]
    start = first.described(first.first).parameters
    assert np.hypot(float(start['x']) - 0.16, float(start['z']) - 0.3) < 0.06
    assert -60.0 < float(start['rate']) < -15.0


def test_gap_arises_at_a_streak_that_no_effect_of_the_library_describes(tmp_path):
    ends = {'x': 0.15, 'x_end': 0.34, 'z': 0.3, 'z_end': 0.3}
    tight = {'width': 0.008, 'permeability_factor': 0.01}
    streak = EffectDescription(name='streak', parameters={**ends, **tight})
    strongest = map_gap(open_recording(recorded(tmp_path / 'recording', streak))).spots[0]
    assert 0.12 < strongest.x < 0.37
    assert strongest.z == pytest.approx(0.3, abs=0.05)
    assert strongest.share > 0.3


def test_a_recording_too_short_to_judge_is_refused_in_one_line(tmp_path):
    from diagnosis_examples import SMALL, schedule

    from porotwin_rig.made_experiment import make_experiment

    make_experiment(
        tmp_path / 'short',
        SMALL,
        commanded=schedule(),
        duration=300,
        photo_interval=60,
        seed=1,
        grid=SMALL.grid(47, 28),
    )
    with pytest.raises(InputError, match='too few'):
        diagnose(tmp_path / 'short', tmp_path / 'out')


def with_frames(recording, times, maps):
    series = ConcentrationMaps(times, recording.grid, lambda start, stop: maps[start:stop])
    return replace(recording, maps=series)


def test_a_recording_whose_tracer_comes_late_is_refused_in_one_line(quiet):
    recording = open_recording(quiet)
    late = np.concatenate([[0.0], recording.times[-9:]])
    maps = np.stack([recording.concentration[0], *recording.concentration[-9:]])
    with pytest.raises(InputError, match='no tracer in its first 70 %'):
        read_sample(with_frames(recording, late, maps))


def test_a_blocked_view_is_not_a_place_where_the_gap_arises(quiet):
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    free = map_gap(with_frames(recording, recording.times, maps)).strength
    maps[15] = np.nan
    blocked = map_gap(with_frames(recording, recording.times, maps)).strength
    assert np.linalg.norm(blocked) < 1.5 * np.linalg.norm(free)


def test_photographs_in_quick_succession_do_not_hide_where_the_gap_arises(tmp_path):
    leak = {'x': 0.62, 'z': 0.30, 'rate': 90.0}
    recording = open_recording(
        recorded(tmp_path / 'recording', EffectDescription(name='leak', parameters=leak))
    )
    times, maps = np.array(recording.times), np.array(recording.concentration)
    order = np.argsort(np.concatenate([times, times[10:12] + 1.0]), kind='stable')
    noisy = maps[10:12] + 0.02 * np.random.default_rng(1).standard_normal(maps[10:12].shape)
    quick = with_frames(
        recording,
        np.concatenate([times, times[10:12] + 1.0])[order],
        np.concatenate([maps, np.clip(noisy, 0, 1).astype(maps.dtype)])[order],
    )
    plain, burst = map_gap(recording), map_gap(quick)
    assert burst.strength == pytest.approx(plain.strength, abs=1e-12)


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


def test_setpoints_that_change_with_every_photograph_are_one_stretch_of_one_state():
    rows = [ScheduleRow(30.0 * n, 'injector', WellRate((1 + n) * 1e-8, 1.0)) for n in range(20)]
    rows.append(ScheduleRow(600.0, 'injector', WellRate()))
    moments = [[(60.0 * n, 60.0 * n + 60.0, 1.0) for n in range(20)]]
    injecting, resting = _phases(moments, [Schedule(tuple(rows))])
    assert (injecting.start, injecting.end, injecting.state) == (0.0, 600.0, 'injecting')
    assert (resting.start, resting.end, resting.state) == (600.0, 1200.0, 'resting')
    assert injecting.share == pytest.approx(0.5)


def test_no_gap_arises_where_nobody_sees(quiet):
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    maps[:, 5:45, 20:70] = np.nan
    blind = map_gap(with_frames(recording, recording.times, maps)).strength
    assert blind[18:32, 35:55].max() == 0.0


def test_a_preset_that_does_not_exist_is_refused_before_the_search(quiet, tmp_path):
    stages = []
    with pytest.raises(InputError, match="preset 'fats': unknown"):
        diagnose(quiet, tmp_path, preset='fats', progress=lambda stage, _: stages.append(stage))
    assert stages == []


def test_a_report_that_cannot_be_written_is_refused_before_the_search(quiet, tmp_path):
    taken = tmp_path / 'taken'
    taken.write_text('a file')
    stages = []
    for output, complaint in ((taken, 'exists; name another'), (quiet, 'is the recording; name')):
        with pytest.raises(InputError, match=complaint):
            diagnose(quiet, output, progress=lambda stage, _: stages.append(stage))
    assert stages == []


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


def test_nothing_arises_while_all_pumps_rest(tmp_path):
    """A wrong porosity acts with the flow; what two maps at rest differ by is noise."""
    rows = [
        ScheduleRow(0.0, 'injector', WellRate(from_ml_h(600.0), 1.0)),
        ScheduleRow(1200.0, 'injector', WellRate()),
    ]
    porosity = EffectDescription(name='porosity', parameters={'factor': 0.85})
    folder = recorded(tmp_path / 'recording', porosity, told=Schedule(tuple(rows)))
    phases = map_gap(open_recording(folder)).phases
    resting = [phase for phase in phases if phase.state == 'resting']
    assert sum(phase.share for phase in resting) < 0.05
