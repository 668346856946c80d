"""The map of the gap: hot spots and phases of known effects."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import CHASE, DENSER, SMALL, commanded, recorded, with_frames

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.model.gap_map import StepEnergy, map_gap, operating_phases
from porotwin_recording.experiment.recording import open_recording


def test_a_gap_arises_at_the_leak_and_not_downstream_of_it(tmp_path):
    leak = EffectDescription(name='leak', parameters={'x': 0.33, 'z': 0.3, 'rate': -80.0})
    gap = map_gap(open_recording(recorded(tmp_path / 'recording', leak)))
    spots = gap.spots[:2]
    assert min(np.hypot(spot.x - 0.33, spot.z - 0.3) for spot in spots) < 0.1
    assert sum(phase.share for phase in gap.phases) == pytest.approx(1.0, abs=0.01)
    assert {phase.state for phase in gap.phases} <= {'injecting', 'resting', 'chasing'}


def test_a_gap_arises_at_a_streak_that_is_no_effect_of_the_library(tmp_path):
    ends = {'x': 0.15, 'x_end': 0.34, 'z': 0.3, 'z_end': 0.3}
    tight = {'width': 0.008, 'permeability_factor': 0.01}
    streak = EffectDescription(name='streak', parameters={**ends, **tight})
    strongest = map_gap(open_recording(recorded(tmp_path / 'recording', streak))).spots[0]
    assert 0.12 < strongest.x < 0.37
    assert strongest.z == pytest.approx(0.3, abs=0.05)
    assert strongest.share > 0.3


def test_a_blocked_view_makes_no_gap(quiet):
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    free = map_gap(with_frames(recording, recording.times, maps)).strength
    maps[15] = np.nan
    blocked = map_gap(with_frames(recording, recording.times, maps)).strength
    assert np.linalg.norm(blocked) < 1.5 * np.linalg.norm(free)


def test_an_effect_makes_no_gap_before_its_onset(quiet):
    recording = open_recording(quiet)
    values = {'well': 'injector', 'factor': 2.0, 'since': float(recording.times[-1])}
    late = recording.rig.with_effects([EffectDescription(name='rate', parameters=values)])
    found, usual = (map_gap(replace(recording, rig=rig)) for rig in (late, recording.rig))
    np.testing.assert_array_equal(found.strength, usual.strength)


def test_photographs_in_quick_succession_do_not_change_the_map(tmp_path):
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


def test_rates_that_change_with_every_photograph_are_one_phase_of_one_state():
    rows = [ScheduleRow(30.0 * n, 'injector', WellRate((1 + n) * 1e-8, 1.0)) for n in range(20)]
    rows.append(ScheduleRow(600.0, 'injector', WellRate()))
    steps = [[StepEnergy(60.0 * n, 60.0 * n + 60.0, 1.0) for n in range(20)]]
    injecting, resting = operating_phases(steps, [Schedule(tuple(rows))])
    assert (injecting.start, injecting.end, injecting.state) == (0.0, 600.0, 'injecting')
    assert (resting.start, resting.end, resting.state) == (600.0, 1200.0, 'resting')
    assert injecting.share == pytest.approx(0.5)


def test_no_gap_arises_in_unseen_cells(quiet):
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    maps[:, 3:30, 13:46] = np.nan
    blind = map_gap(with_frames(recording, recording.times, maps)).strength
    assert blind[12:21, 23:36].max() == 0.0


def test_no_gap_arises_while_all_pumps_rest(tmp_path):
    """A wrong porosity acts with the flow; two maps at rest differ by noise only."""
    rates = commanded((0, 'injector', 600, 1.0), (1200, 'injector', 0, 0.0))
    porosity = EffectDescription(name='porosity', parameters={'factor': 0.85})
    phases = map_gap(open_recording(recorded(tmp_path / 'recording', porosity, rates=rates))).phases
    resting = [phase for phase in phases if phase.state == 'resting']
    assert sum(phase.share for phase in resting) < 0.05


def test_the_gap_of_several_recordings_is_mapped_together_and_separately(tmp_path):
    injection = commanded((0, 'injector', 450, 1.0))
    folders = [
        recorded(tmp_path / 'injection', DENSER, rates=injection, duration=2160),
        recorded(tmp_path / 'chase', DENSER, rates=CHASE, duration=2160, grid=SMALL.grid(84, 50)),
    ]
    recordings = [open_recording(folder) for folder in folders]
    together = map_gap(*recordings)
    for recording, strength in zip(recordings, together.each, strict=True):
        np.testing.assert_allclose(strength, map_gap(recording).strength)
    assert together.strength.shape == recordings[0].grid.shape
    assert sum(phase.share for phase in together.phases) == pytest.approx(1.0, abs=0.01)
    assert {(phase.recording, phase.state) for phase in together.phases} == {
        (0, 'injecting'),
        (1, 'injecting'),
        (1, 'chasing'),
    }
    assert np.hypot(together.spots[0].x - 0.235, together.spots[0].z - 0.235) < 0.15


def test_a_recording_without_a_gap_gets_a_map_without_places(quiet):
    gap = map_gap(open_recording(quiet))
    assert gap.phases
    plain = gap.without_places()
    assert (plain.spots, plain.phases) == ((), ())
    np.testing.assert_array_equal(plain.strength, gap.strength)
