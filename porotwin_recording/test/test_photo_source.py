"""Tests of the fingerprints: whatever the maps depend on changes one of them, and nothing else."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from recording_examples import bench_rig

from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_recording.experiment.photo_source import fingerprints
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.photos import Photo


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    """A folder with a baseline and a photograph."""
    photos = []
    for time, role in ((0.0, 'baseline'), (30.0, 'state')):
        path = tmp_path / f'{role}.jpg'
        path.write_bytes(b'a photograph')
        photos.append(Photo(time, role, path.name, path.read_bytes, path))  # type: ignore[arg-type]
    return Recording(rig=bench_rig(), photos=tuple(photos), source=tmp_path)


def other_camera(recording: Recording) -> Recording:
    return replace(recording, rig=recording.rig.model_copy(update={'camera': None}))


def other_time(recording: Recording) -> Recording:
    first, second = recording.photos
    return replace(recording, photos=(first, replace(second, time=31.0)))


def other_photograph(recording: Recording) -> Recording:
    path = recording.photos[1].path
    assert path is not None
    path.write_bytes(b'another one')
    return recording


def touched_in_place(recording: Recording) -> Recording:
    path = recording.photos[0].path
    assert path is not None
    os.utime(path, (1.0, 1.0))
    return recording


def other_rates(recording: Recording) -> Recording:
    return replace(recording, commanded=Schedule.constant({'injector': WellRate(1e-7, 1.0)}))


@pytest.mark.parametrize(
    ('change', 'names'),
    [
        (lambda recording: recording, set()),
        (other_camera, {'rig.yaml'}),
        (other_time, {'photographs'}),
        (other_photograph, {'photographs'}),
        (touched_in_place, {'photographs'}),
        (other_rates, {'rates'}),
    ],
)
def test_each_change_is_named(
    recording: Recording, change: Callable[[Recording], Recording], names: set[str]
) -> None:
    before = fingerprints(recording)
    after = fingerprints(change(recording))
    assert {name for name in before if before[name] != after[name]} == names
