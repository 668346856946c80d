"""An archive: many recordings, each diagnosed alone, several at the same time.

Every recording gets a folder with its report. A recording is done if its report was made from it,
with the same rig and preset. So an interrupted archive continues where it stopped.
"""

import json
import logging
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError, refuse_file, writing
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.parallel import Crew, SchedulerLost
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.whole_file import write_whole
from porotwin_core.rig import Rig
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_diagnosis.report.origin import (
    check_unchanged,
    files_mark,
    own_rig,
    place_of,
    rig_mark,
)
from porotwin_diagnosis.report.report_folder import (
    REPORT,
    SUMMARY,
    check_apart,
    checked_folder,
    write_diagnosis,
)
from porotwin_recording.experiment.recording import open_recording

RECORDING_BYTES = 1.5e9
"""Memory of one diagnosis with one worker [B]."""

TABLE = 'archive.json'
"""File in the folder of an archive with one entry per recording."""

LOG = logging.getLogger('porotwin')
"""Receives a warning for every report that is made again."""


@dataclass(frozen=True)
class ArchiveTask:
    """One recording of an archive, its own `rig` or None, and the `folder` of its report."""

    recording: Path
    folder: Path
    rig: Rig | None = None
    preset: str = 'accurate'

    @property
    def is_done(self) -> bool:
        """Whether there is a complete report, and this task would make the same."""
        return self.has_report and not self.difference

    @property
    def has_report(self) -> bool:
        """Whether there is a complete report in the folder, of this task or another."""
        return (self.folder / REPORT).exists()

    @property
    def difference(self) -> str:
        """Why this task would make another report than the one in the folder; empty: it would not.

        A report of an older version does not tell its rig and files. Then recording and preset
        count alone.
        """
        try:
            found = json_value(read_regular(self.folder / SUMMARY))
            made, recordings = found['made_with'], found['recordings']
            preset, excluded, read = made['preset'], made['excluded'], made.get('read')
            named = [one['recording'] for one in read] if read else recordings
            places = [place_of(one) for one in named]
        except (InputError, OSError, ValueError, LookupError, TypeError, AttributeError):
            return f'{SUMMARY} does not tell the origin of the report'
        if places != [place_of(self.recording)]:
            return f'the report belongs to {" and ".join(map(str, places))}'
        if preset != self.preset:
            return f'the report was made with the preset {preset}'
        if excluded:
            return f'the report was made without {", ".join(excluded)}'
        if found.get('belief'):
            return 'the report was made with --history'
        if found.get('untried'):
            return f'its search was ended before it tried {found["untried"]}'
        return self._change_since(read[0]) if read else ''

    def _change_since(self, read: dict[str, Any]) -> str:
        """Return how the task differs from the origin `read` of a report; empty: not at all."""
        try:
            if read.get('files') != files_mark(self.recording):
                return 'the recording has changed since the report'
            rig = own_rig(self.recording) if self.rig is None else self.rig
        except (InputError, OSError):
            return 'the recording cannot be read as at the time of the report'
        if read.get('rig') != rig_mark(rig):
            return 'the report was made with another description of the rig'
        return ''

    def work(self) -> None:
        """Diagnose the recording and write its report.

        Raises:
            InputError: as `examine`, or the recording changed meanwhile.
        """
        marks = {self.recording: files_mark(self.recording)}
        opened = open_recording(self.recording, rig=self.rig)
        folder = checked_folder(self.folder, [self.recording])
        result = examine([opened], DiagnosisSettings(preset=self.preset))
        check_unchanged(marks)
        write_diagnosis(result, folder)


def archive_tasks(
    recordings: Sequence[Path], output: Path, *, rig: Rig | None = None, preset: str = 'accurate'
) -> list[ArchiveTask]:
    """Return the tasks of an archive; the folder of a recording in `output` has its name.

    Raises:
        InputError: a recording is named twice, two have the same name, or `output` holds the files
            of one.
    """
    check_apart(output, recordings)
    places = [place_of(recording) for recording in recordings]
    again = next((place for place in places if places.count(place) > 1), None)
    if again is not None:
        raise InputError(f'--each: {again} is named twice; name every recording once')
    names = [place.name for place in places]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            f"--each: two recordings are called '{twice[0]}'; their reports need folders with "
            'different names, so rename one'
        )
    return [ArchiveTask(place, output.resolve() / place.name, rig, preset) for place in places]


def diagnose_archive(
    tasks: Iterable[ArchiveTask],
    output: Path,
    crew: Crew,
    done: Callable[[str], None] = lambda _: None,
) -> list[dict[str, Any]]:
    """Diagnose the recordings without a report of their own; return the table of them.

    The table in the folder keeps the rows of other recordings whose folders are still there.

    Args:
        tasks: the recordings.
        output: folder of the archive.
        crew: does the tasks, each in a process, because netCDF is not thread-safe.
        done: called with the name of each recording when its report is written.

    Raises:
        InputError: a worker does not see `output`.
        SchedulerLost: the scheduler went away; the same call continues.
    """
    listed = list(tasks)
    refuse_file(output, 'the reports')
    output.mkdir(parents=True, exist_ok=True)
    crew.needs_folder(output)
    refused: dict[str, str] = {}
    left = [task for task in listed if not task.is_done]
    for task in left:
        if task.has_report:
            LOG.warning('%s: %s; it is diagnosed again', task.folder, task.difference)
    futures = {crew.submit(task.work): task for task in left}
    for future in as_completed(futures):
        name = futures[future].folder.name
        try:
            future.result()
        except (SchedulerLost, CancelledError):  # no fault of this recording
            raise
        except (InputError, OSError) as error:  # the others are diagnosed all the same
            refused[name] = str(error)
        except Exception as error:  # a fault of the program; hours of work go on
            LOG.exception('%s: failed', name)
            refused[name] = f'failed: {error!r}'
        done(name)
    table = [_row(task, refused.get(task.folder.name)) for task in listed]
    rows = {row['report']: row for row in [*_earlier_rows(output / TABLE), *table]}
    with writing(output / TABLE):
        write_whole(output / TABLE, json.dumps(list(rows.values()), indent=1))
    return table


def _earlier_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of an earlier table whose folders are still there."""
    try:
        rows = json_value(path.read_text(encoding='utf-8'))
        return [row for row in rows if Path(row['report']).is_dir()]
    except (OSError, ValueError, LookupError, TypeError):
        return []


def _row(task: ArchiveTask, refusal: str | None) -> dict[str, Any]:
    """Return the entry of one recording: its verdict, or why it was refused."""
    row: dict[str, Any] = {'recording': str(task.recording), 'report': str(task.folder)}
    if refusal is not None:
        return row | {
            'verdict': None, 'combination': [], 'confidence': None, 'refused': refusal,
        }  # fmt: skip
    found = json_value((task.folder / SUMMARY).read_text(encoding='utf-8'))
    return row | {
        'verdict': found['verdict'],
        'combination': found['combination'],
        'confidence': found['confidence'],
        'refused': None,
    }
