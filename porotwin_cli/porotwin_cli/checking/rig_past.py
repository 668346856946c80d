"""The earlier findings on a rig beside the diagnosis of a new recording of it."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from porotwin_cli.terminal import say
from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.history.comparison import compared
from porotwin_diagnosis.history.past_findings import (
    PastFinding,
    add_finding,
    finding_from,
    findings_on,
    is_virtual,
    prepare_history,
    read_history,
)
from porotwin_diagnosis.report.origin import place_of
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.recording_date import date_of_files, parse_date


def _past(date: datetime) -> datetime:
    """Return the date of a recording, today at the latest.

    Raises:
        InputError: it lies in the future.
    """
    if date.date() > datetime.now().astimezone().date():
        raise InputError(f'--date {date:%Y-%m-%d}: lies in the future; give the day of recording')
    return date


class RigPast:
    """The earlier findings on a rig, and the place of the next one.

    Attributes:
        before: the findings up to the date of the new recording, when this object was made.
    """

    def __init__(self, folder: Path, recordings: Sequence[Recording], date: str) -> None:
        """Read the findings in `folder`.

        Raises:
            InputError: the folder, its file or the date cannot be used, or the rig is another one.
        """
        self._folder = folder
        self._recordings = recordings
        source = recordings[0].source
        self._date = _past(parse_date(date)) if date else date_of_files(source)
        if not date:
            say(
                f'{source}: date of the recording taken from its files: '
                f'{self._date.astimezone(UTC):%Y-%m-%d %H:%M} UTC; if that is wrong, give --date'
            )
        prepare_history(folder)
        self._virtual = is_virtual(recordings)
        if self._virtual:
            say(
                f'{source}: was made by the virtual rig. Its finding is kept as virtual, and never '
                'counts for recordings of the real rig.'
            )
        others = self._others()
        self.before = self._up_to_date(others)
        later = len(others) - len(self.before)
        if later:
            say(
                f'{folder}: {later} findings on this rig are dated later than {self._date:%H:%M} '
                f'of {self._date:%Y-%m-%d} and do not count; --date states another day'
            )

    def _up_to_date(self, findings: Sequence[PastFinding]) -> list[PastFinding]:
        """Return the `findings` up to the date of the recording."""
        return [one for one in findings if one.seconds <= self._date.timestamp()]

    def _others(self) -> list[PastFinding]:
        """Return the findings on this rig from other recordings, whatever their date."""
        own = {str(place_of(recording.source)) for recording in self._recordings}
        findings = read_history(self._folder)
        rig = self._recordings[0].rig
        found = findings_on(rig, findings, self._folder, virtual=self._virtual)
        return [one for one in found if not own & set(one.recordings)]

    def compare(self, summary: Mapping[str, Any]) -> list[str]:
        """Return lines on how the finding in `summary` fits to the earlier ones."""
        before = self._up_to_date(self._others())  # another call may have added one meanwhile
        return compared(before, finding_from(summary, self._recordings, self._date))

    def remember(self, summary: Mapping[str, Any]) -> list[str]:
        """Add the finding in `summary`; return a line if it replaces others, or is not added."""
        new = finding_from(summary, self._recordings, self._date)
        replaced = add_finding(self._folder, new)
        lines: list[str] = []
        lost = {name for found in replaced for name in found.recordings} - set(new.recordings)
        if lost:
            names = ', '.join(sorted(lost))
            lines.append(f'A finding on {names} together with this recording was replaced.')
        if new not in read_history(self._folder):
            lines.append(
                'The history keeps its finding on this recording together with others; this one is '
                'not added.'
            )
        return lines
