"""The one place that opens a NetCDF file for reading.

A few damaged bytes can make HDF5 crash, or search for ever, while it opens a file. Nothing ends a
call inside a library. Another process therefore opens each file first.
"""

import atexit
import json
import os
import subprocess
import sys
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import regular

if TYPE_CHECKING:
    import netCDF4

LONGEST_OPEN_S = 10
"""Longest time to open a file [s]; it takes milliseconds, whatever the size."""

TASTING = """
import json, signal, sys
import netCDF4
print(flush=True)
for line in sys.stdin:
    signal.alarm(int(sys.argv[1]))
    try:
        with netCDF4.Dataset(json.loads(line)) as dataset:
            for variable in dataset.variables.values():
                variable.ncattrs()
    except Exception:
        pass
    signal.alarm(0)
    print(flush=True)
"""
"""Opens each file that is named on a line, and answers with an empty line unless that harms."""


class Taster:
    """A process that opens files first; it starts with the first file and ends with this one."""

    def __init__(self) -> None:
        self.forget()
        os.register_at_fork(after_in_child=self.forget)
        atexit.register(self.end)

    def forget(self) -> None:
        """Start another process for the next file; this one may be that of another process."""
        self._lock = Lock()
        self._process: subprocess.Popen[str] | None = None

    def end(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.communicate()
        self._process = None

    def survives(self, path: Path) -> bool:
        """Return whether the process survives the opening of `path`."""
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                # a folder that a person works in must not replace modules, nor Ctrl-C end it
                self._process = subprocess.Popen(
                    [sys.executable, '-P', '-c', TASTING, str(LONGEST_OPEN_S)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.DEVNULL,
                    start_new_session=True,
                    text=True,
                )
                self._answers(self._process)  # that it has begun
            print(json.dumps(str(path.resolve())), file=self._process.stdin, flush=True)
            if self._answers(self._process):
                return True
            self.end()
            return False

    @staticmethod
    def _answers(process: subprocess.Popen[str]) -> bool:
        assert process.stdout is not None
        return bool(process.stdout.readline())


_taster = Taster()


def open_netcdf(path: Path) -> 'netCDF4.Dataset':
    """Open a NetCDF file for reading.

    Raises:
        InputError: it is a FIFO, a socket or a device, or it harms whoever opens it.
        OSError: there is no file, or it is no NetCDF.
    """
    import netCDF4  # takes a tenth of the start of a node, and few nodes read such files

    if not _taster.survives(regular(path)):
        raise InputError(
            f'{path}: is damaged (HDF5 crashes at it, or opens it for more than '
            f'{LONGEST_OPEN_S} s); write it again'
        )
    return netCDF4.Dataset(path)
