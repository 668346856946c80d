"""The time of the first photograph of an experiment, kept in a file over a restart of the node.

The file also names the baselines of the experiment: a restarted node is offered those of all
experiments of the camera.
"""

import json
import math
from collections.abc import Collection
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.whole_file import write_whole


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
        self._baselines: frozenset[str] = frozenset()
        if file is not None and file.is_file():
            self.time, self._baselines = _noted(file)
        self._is_new_process = True

    def goes_on(self, time: float) -> bool:
        """Return whether a sequence that starts at `time` [s] continues the experiment.

        It does if it is the first one of a process that was started again.
        """
        first, self._is_new_process = self._is_new_process, False
        return first and self.time is not None and time > self.time

    def is_over(self, time: float, digest: str) -> bool:
        """Return whether the baseline at `time` [s] belongs to an experiment before this one.

        That is asked by a process that was started again, until it has read a photograph. A
        baseline that was taken since this experiment began belongs to it, or to the next one.
        """
        if not self._is_new_process or self.time is None or not self._baselines:
            return False
        return time < self.time and digest not in self._baselines

    def note(self, time: float, baselines: Collection[str] = ()) -> None:
        """Note that an experiment begins with the photograph at `time` [s].

        Args:
            time: of the photograph [s].
            baselines: digests of the baselines in use.

        Raises:
            OSError: the file cannot be written; the start counts in this process all the same.
        """
        self.time, self._is_new_process = time, False
        self._baselines = frozenset(baselines)
        if self._file is not None:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            noted = {'first_photograph_s': time, 'baselines': sorted(baselines)}
            write_whole(self._file, json.dumps(noted))


def _noted(file: Path) -> tuple[float, frozenset[str]]:
    """Return the time of the first photograph [s], and the digests of the baselines."""
    baselines: frozenset[str] = frozenset()
    try:
        noted = json_value(read_regular(file))
        time = float(noted['first_photograph_s'])
        baselines = frozenset(map(str, noted.get('baselines', ())))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        time = math.nan
    if not math.isfinite(time):
        raise InputError(f'{file}: holds no time of a first photograph; delete it')
    return time, baselines
