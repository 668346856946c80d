"""The time of the first photograph of an experiment, kept in a file over a restart of the node."""

import json
import math
from pathlib import Path

from porotwin_core.errors import InputError
from porotwin_core.whole_file import write_whole


class ExperimentStart:
    """Knows when the experiment began, also after a restart of the process."""

    def __init__(self, file: Path | None) -> None:
        """Read the start that an earlier process has noted in `file`; None: there is no file.

        Raises:
            InputError: the file holds no time.
        """
        self._file = file
        self.time: float | None = None
        """Time of the first photograph [s]; None: no experiment has begun."""
        if file is not None and file.is_file():
            self.time = _noted(file)
        self._is_new_process = True

    def goes_on(self, time: float) -> bool:
        """Return whether a sequence that starts at `time` [s] continues the experiment.

        It does if it is the first one of a process that was started again.
        """
        first, self._is_new_process = self._is_new_process, False
        return first and self.time is not None and time > self.time

    def note(self, time: float) -> None:
        """Note that an experiment begins with the photograph at `time` [s].

        Raises:
            OSError: the file cannot be written; the start counts in this process all the same.
        """
        self.time, self._is_new_process = time, False
        if self._file is not None:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(self._file, json.dumps({'first_photograph_s': time}))


def _noted(file: Path) -> float:
    try:
        time = float(json.loads(file.read_text('utf-8'))['first_photograph_s'])
    except (OSError, ValueError, KeyError, TypeError):
        time = math.nan
    if not math.isfinite(time):
        raise InputError(f'{file}: holds no time of a first photograph; delete it')
    return time
