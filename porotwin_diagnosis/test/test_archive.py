"""An archive: its recordings one by one, and a second call that continues."""

import json
from pathlib import Path

import pytest

from porotwin_core.errors import InputError
from porotwin_core.parallel import crew
from porotwin_diagnosis.archive import TABLE, archive_tasks, diagnose_archive
from porotwin_diagnosis.report.report_folder import REPORT


def test_a_recording_with_a_report_is_kept_and_a_bad_one_is_named(tmp_path: Path) -> None:
    recordings = [tmp_path / 'monday', tmp_path / 'tuesday']
    tasks = archive_tasks(recordings, tmp_path / 'archive')
    done = tasks[0].folder
    done.mkdir(parents=True)
    (done / 'diagnosis.json').write_text(json.dumps({'verdict': 'rate', 'confidence': 0.9}))
    (done / REPORT).touch()
    named: list[str] = []
    with crew(workers=2, threads=True) as pool:
        table = diagnose_archive(tasks, tmp_path / 'archive', pool, named.append)
    assert named == ['tuesday']
    assert [row['verdict'] for row in table] == ['rate', None]
    assert 'tuesday' in table[1]['refused']
    assert json.loads((tmp_path / 'archive' / TABLE).read_text()) == table


def test_two_recordings_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="two recordings are called 'monday'"):
        archive_tasks([tmp_path / 'a' / 'monday', tmp_path / 'b' / 'monday'], tmp_path)
