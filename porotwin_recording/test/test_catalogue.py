"""Tests of the catalogue of recordings."""

import json
import os
import tracemalloc
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from recording_examples import bench_experiment, bench_rig, write_live_bag
from sparse_bags import START, SparseBag

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import EffectDescription
from porotwin_core.ros.conversions import rig_to_msg
from porotwin_msgs.msg import Effect, ModelEffects
from porotwin_recording.experiment.bag_conversion import import_experiment
from porotwin_recording.experiment.catalogue import catalogue_entry, find_recordings, without_copies
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.experiment.known_verdicts import KnownVerdicts
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.mcap.serialization import SECOND

GIGABYTE = 10**9
PHOTOGRAPH = 36_000_000


def large_bag(path: Path, *, photographs: int = 40, closed: bool = True) -> Path:
    """Write a bag whose photographs have 36 MB each."""
    bag = SparseBag(path, bench_rig())
    bag.photograph(-1, PHOTOGRAPH, topic='camera/baseline/compressed')
    for number in range(photographs):
        bag.photograph(number, PHOTOGRAPH)
    if closed:
        bag.close()
    return path


def peak_bytes(work) -> int:
    """Return the largest memory of Python's objects during `work`."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize('closed', [True, False])
def test_a_bag_of_gigabytes_is_listed_and_opened_without_its_photographs(
    tmp_path: Path, closed: bool
) -> None:
    path = large_bag(tmp_path / 'long.mcap', closed=closed)
    entry = catalogue_entry(path)
    assert entry.size_bytes > 1.4 * GIGABYTE
    assert (entry.photographs, entry.maps, entry.rig) == (40, 0, 'bench')
    assert entry.duration_s == 30.0 * 40
    assert entry.start == datetime.fromtimestamp(START / SECOND - 30.0, UTC)
    assert entry.state == ('complete' if closed else 'recording')
    recording = open_recording(path)
    assert len(recording.photos) == 41
    assert recording.photos[1].time == 0.0
    for work in (lambda: catalogue_entry(path), lambda: open_recording(path)):
        # without an index, names of topics are looked for in a chunk
        assert peak_bytes(work) < (0.003 * entry.size_bytes if closed else 4 * PHOTOGRAPH)
    # one photograph at a time: the chunk, the message and the file
    assert peak_bytes(recording.photos[3].read) < 5 * PHOTOGRAPH
    assert len(recording.photos[3].read()) == PHOTOGRAPH


def test_the_entries_of_a_folder_and_of_its_bag_agree(tmp_path: Path) -> None:
    data = bench_experiment()
    late = Schedule((ScheduleRow(5000.0, next(iter(data.rig.wells)), WellRate()),))
    write_folder(tmp_path / 'experiment', replace(data, measured=late))
    import_experiment(tmp_path / 'experiment', tmp_path / 'bag')
    bag, folder = (catalogue_entry(path) for path in find_recordings(tmp_path))
    assert (folder.kind, bag.kind) == ('folder', 'bag')
    for name in ('rig', 'photographs', 'maps', 'setpoints', 'width_m', 'duration_s'):
        assert getattr(folder, name) == pytest.approx(getattr(bag, name)), name
    assert bag.start is None  # an imported experiment has no date
    assert folder.size_bytes > 1000


def test_a_folder_with_tables_and_a_bag_is_listed_once_beside_the_bag(tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    write_folder(folder, replace(bench_experiment(), photos=()))
    import_experiment(folder, folder / 'run_0.mcap')
    entries = [catalogue_entry(path) for path in find_recordings(folder)]
    assert [(one.kind, one.path.name) for one in entries] == [
        ('folder', 'run'),
        ('bag', 'run_0.mcap'),
    ]
    assert [one.start for one in entries] == [None, None]  # an import has no date


def test_a_bag_beside_the_tables_of_the_same_experiment_is_no_second_run(tmp_path: Path) -> None:
    folder = tmp_path / 'run'
    write_folder(folder, bench_experiment())
    import_experiment(folder, folder / 'run_0.mcap')
    other = large_bag(folder / 'other.mcap', photographs=3)
    entries = without_copies(map(catalogue_entry, find_recordings(tmp_path)))
    assert [one.path for one in entries] == [folder, other]
    (line,) = entries[0].remarks
    assert 'run_0.mcap' in line


def test_the_parts_of_a_bag_are_one_bag_from_inside_its_folder_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'run').mkdir()
    for number in (0, 1):  # without metadata.yaml, as a killed recorder leaves them
        large_bag(tmp_path / 'run' / f'run_{number}.mcap', photographs=1)
    monkeypatch.chdir(tmp_path / 'run')
    assert list(find_recordings(Path())) == [Path()]


def test_effects_and_diagnoses_are_told(tmp_path: Path) -> None:
    rig = bench_rig().model_copy(update={'effects': (EffectDescription(name='decay'),)})
    mended = ModelEffects(effects=[Effect(name='leak')])
    write_live_bag(
        tmp_path / 'up' / 'bag',
        [
            ('/rig2/rig/description', rig_to_msg(rig)),
            ('/rig2/solver/effects', ModelEffects()),
            ('/rig2/solver/effects', mended),
        ],
    )
    diagnosis = tmp_path / 'up' / 'diagnoses' / '1'
    diagnosis.mkdir(parents=True)
    (diagnosis / 'diagnosis.json').write_text(json.dumps({'verdict': 'leak', 'confidence': 0.93}))
    (path,) = find_recordings(tmp_path)
    entry = catalogue_entry(path, KnownVerdicts(tmp_path))
    assert entry.effects == ('decay', 'leak')
    assert entry.diagnosed == 'leak (93 %)'
    ended = {'verdict': 'leak', 'confidence': 0.6, 'untried': 'pairs of effects'}
    (diagnosis / 'diagnosis.json').write_text(json.dumps(ended))
    assert KnownVerdicts(tmp_path).of(path) == 'preliminary: leak (60 %)'


def test_the_newest_report_on_a_recording_is_told(tmp_path: Path) -> None:
    monday, tuesday = tmp_path / 'monday', tmp_path / 'tuesday'
    for number, (recording, verdict) in enumerate(
        [(monday, 'rate'), (tuesday, 'none'), (monday, 'leak')]
    ):
        report = tmp_path / 'archive' / str(number) / 'diagnosis.json'
        report.parent.mkdir(parents=True)
        content = {'verdict': verdict, 'confidence': 0.8}
        report.write_text(json.dumps({**content, 'by_recording': [{'recording': str(recording)}]}))
        os.utime(report, (1e9 + number, 1e9 + number))
    (tmp_path / 'archive' / 'diagnosis.json').write_text('{"verdict": 1}')
    verdicts = KnownVerdicts(tmp_path)
    assert verdicts.of(monday) == 'leak (80 %)'
    assert verdicts.of(tuesday) == 'none (80 %)'
    assert verdicts.of(tmp_path) == ''


def test_a_run_that_only_calibrated_has_no_verdict_of_the_twin_beside_it(tmp_path: Path) -> None:
    report = tmp_path / 'diagnoses' / '1' / 'diagnosis.json'
    report.parent.mkdir(parents=True)
    report.write_text('{"verdict": "none", "confidence": 0.9}')
    write_folder(tmp_path / 'calibration_run', bench_experiment())
    (tmp_path / 'bag').mkdir()
    verdicts = KnownVerdicts(tmp_path)
    assert verdicts.of(tmp_path / 'bag') == 'none (90 %)'
    assert verdicts.of(tmp_path / 'calibration_run') == ''


def test_broken_recordings_have_their_fault_in_one_line(tmp_path: Path) -> None:
    (tmp_path / 'empty.mcap').touch()
    (tmp_path / 'text.mcap').write_text('no bag')
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'folder' / 'rig.yaml').write_text('name: [')
    (tmp_path / 'folder' / 'rates.csv').touch()
    whole = large_bag(tmp_path / 'whole.mcap', photographs=3)
    content = whole.read_bytes()
    (tmp_path / 'damaged.mcap').write_bytes(content[:2000] + b'\x99' * 5000)
    entries = {entry.path.name: entry for entry in map(catalogue_entry, find_recordings(tmp_path))}
    assert len(entries) == 5
    for name in ('empty.mcap', 'text.mcap', 'folder', 'damaged.mcap'):
        assert entries[name].state in ('unreadable', 'recording'), name
        (line,) = entries[name].remarks
        assert str(tmp_path / name) in line
        assert '\n' not in line
    assert entries['whole.mcap'].state == 'complete'


def test_only_a_folder_without_its_whole_maps_is_unfinished(tmp_path: Path) -> None:
    write_folder(tmp_path / 'run', bench_experiment())
    (tmp_path / 'run' / 'concentration.nc').rename(tmp_path / 'run' / 'concentration.nc.partial')
    assert catalogue_entry(tmp_path / 'run').state == 'unfinished'
    (tmp_path / 'run' / 'concentration.nc.partial').unlink()
    (tmp_path / 'run' / 'imaging.csv').unlink()
    (tmp_path / 'run' / 'photos').rename(tmp_path / 'run' / 'DCIM')
    plain = catalogue_entry(tmp_path / 'run')
    assert (plain.state, len(plain.remarks)) == ('complete', 1)


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='no such folder'):
        list(find_recordings(tmp_path / 'nowhere'))


def test_a_file_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'maps.nc').touch()
    with pytest.raises(InputError, match='is no recording; name a folder'):
        list(find_recordings(tmp_path / 'maps.nc'))
