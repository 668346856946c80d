"""An archive: many recordings, each diagnosed alone, several at the same time.

Every recording gets a folder with its report. A recording whose report exists is done, so an
interrupted archive continues where it stopped.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from porotwin_core.errors import InputError
from porotwin_core.parallel import Crew
from porotwin_core.rig import Rig
from porotwin_diagnosis.examine import examine
from porotwin_diagnosis.report.report_folder import REPORT, checked_folder, write_diagnosis
from porotwin_recording.recording import open_recording

RECORDING_BYTES = 1.5e9
"""Memory of one diagnosis with one worker [B]."""

TABLE = 'archive.json'
"""File in the folder of an archive with one entry per recording."""


@dataclass(frozen=True)
class ArchiveTask:
    """One recording of an archive, its own `rig` or None, and the `folder` of its report."""

    recording: Path
    folder: Path
    rig: Rig | None = None
    preset: str = 'accurate'

    @property
    def is_done(self) -> bool:
        """Whether the report is complete."""
        return (self.folder / REPORT).exists()

    def work(self) -> None:
        """Diagnose the recording and write its report.

        Raises:
            InputError: as `examine`.
        """
        opened = open_recording(self.recording, rig=self.rig)
        folder = checked_folder(self.folder, [self.recording])
        write_diagnosis(examine([opened], preset=self.preset), folder)


def archive_tasks(
    recordings: Sequence[Path], output: Path, *, rig: Rig | None = None, preset: str = 'accurate'
) -> list[ArchiveTask]:
    """Return the tasks of an archive; the folder of a recording in `output` has its name.

    Raises:
        InputError: two recordings have the same name.
    """
    names = [recording.resolve().name for recording in recordings]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            f"--each: two recordings are called '{twice[0]}'; their reports need folders with "
            'different names, so rename one'
        )
    return [
        ArchiveTask(recording.resolve(), output.resolve() / name, rig, preset)
        for recording, name in zip(recordings, names, strict=True)
    ]


def diagnose_archive(
    tasks: Iterable[ArchiveTask],
    output: Path,
    crew: Crew,
    done: Callable[[str], None] = lambda _: None,
) -> list[dict[str, Any]]:
    """Diagnose the recordings without a report; write and return the table of all.

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
    output.mkdir(parents=True, exist_ok=True)
    crew.needs_folder(output)
    refused: dict[str, str] = {}
    futures = {crew.submit(task.work): task for task in listed if not task.is_done}
    for future in as_completed(futures):
        name = futures[future].folder.name
        try:
            future.result()
        except InputError as error:
            refused[name] = str(error)
        done(name)
    table = [_row(task, refused.get(task.folder.name)) for task in listed]
    (output / TABLE).write_text(json.dumps(table, indent=1), encoding='utf-8')
    return table


def _row(task: ArchiveTask, refusal: str | None) -> dict[str, Any]:
    """Return the entry of one recording: its verdict, or why it was refused."""
    row: dict[str, Any] = {'recording': str(task.recording), 'report': str(task.folder)}
    if refusal is not None:
        return row | {'verdict': None, 'confidence': None, 'refused': refusal}
    found = json.loads((task.folder / 'diagnosis.json').read_text(encoding='utf-8'))
    return row | {
        'verdict': found['verdict'], 'confidence': found['confidence'], 'refused': None,
    }  # fmt: skip
