"""The maps of the last hours, kept in a file without a name, so that memory does not grow."""

import json
import math
import os
import tempfile
import threading
from typing import IO

import numpy as np

from porotwin_core.basis.json_text import json_value
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import WellRate
from porotwin_page.graph_snapshot import (
    HISTORY_LENGTH,
    CyclePoint,
    GraphSnapshot,
    Map,
    ObservedState,
    Setpoint,
    matching,
)

MOST_BYTES = 384 << 20
"""Largest file of states [bytes]: 12 hours on the small rig's default grid, less on finer ones."""

_STORED = np.dtype('<f2')
"""Half precision: three digits of a concentration."""

_MAPS = 3
"""Maps of a state: observed, forecast, difference."""

_HEAD = 4096
"""Bytes of a state before its maps: numbers, time and rates as JSON."""


class PastStates:
    """The last states by number, each with its map, the forecast for it, and their difference.

    Numbers count all states of this process. Threads may add and read at the same time.
    """

    def __init__(self, *, most: int = HISTORY_LENGTH, most_bytes: int = MOST_BYTES) -> None:
        """Keep at most `most` states in a file of at most `most_bytes`."""
        self._most, self._most_bytes = most, most_bytes
        self._lock = threading.Lock()
        self._file: IO[bytes] | None = None
        self._grid: Grid | None = None
        self._places = 0
        self._first = 1
        self._last = 0

    @property
    def first(self) -> int:
        """Number of the oldest state that is kept; 0 if there is none."""
        return self._first if self._last >= self._first else 0

    @property
    def last(self) -> int:
        """Number of the newest state that is kept; 0 if there is none."""
        return self._last if self._last >= self._first else 0

    def add(self, snapshot: GraphSnapshot) -> None:
        """Keep the newest state of `snapshot`; the oldest one gives way.

        Raises:
            OSError: the file cannot be written; the states before are still there.
        """
        state = snapshot.observed
        if state is None or self._most == 0:
            return
        time, grid = state.map.time, state.map.grid
        corrected = matching(snapshot.corrected, time)
        forecast = corrected or matching(snapshot.predicted, time)
        setpoint = snapshot.setpoint
        head = {
            'sequence': state.sequence,
            'time': time,
            'number': state.map.number,
            'is_corrected_map': corrected is not None,
            'corrected': bool(snapshot.history) and snapshot.history[-1].corrected,
            'rates': {well: [r.rate, r.concentration] for well, r in setpoint.rates.items()}
            if setpoint
            else {},
        }
        maps = (
            state.map.concentration,
            forecast.concentration if forecast else None,
            snapshot.difference,
        )
        with self._lock:
            self._open_for(grid)
            content = json.dumps(head).encode()
            if len(content) > _HEAD:  # hundreds of wells
                content = json.dumps({**head, 'rates': {}}).encode()
            self._write(content, maps, grid)

    def _open_for(self, grid: Grid) -> None:
        """Begin a new file for another `grid`."""
        if self._grid == grid and self._file is not None:
            return
        self._close()
        self._grid = grid
        self._places = max(1, min(self._most, self._most_bytes // self._size(grid)))
        self._first = self._last + 1
        self._file = tempfile.TemporaryFile(prefix='porotwin-page-')  # noqa: SIM115  kept open

    def _write(self, head: bytes, maps: tuple[FloatArray | None, ...], grid: Grid) -> None:
        assert self._file is not None
        stored = np.full((_MAPS, *grid.shape), np.nan, dtype=_STORED)
        for place, values in zip(stored, maps, strict=True):
            if values is not None and values.shape == place.shape:
                place[:] = values
        content = head.ljust(_HEAD) + stored.tobytes()
        number = self._last + 1
        self._first = max(self._first, number - self._places + 1)  # its place is written now
        if os.pwrite(self._file.fileno(), content, self._place_of(number)) != len(content):
            raise OSError('the file of past states is not written completely')
        self._last = number

    @staticmethod
    def _size(grid: Grid) -> int:
        return _HEAD + _MAPS * grid.nx * grid.nz * _STORED.itemsize

    def _place_of(self, number: int) -> int:
        assert self._grid is not None
        return (number % self._places) * self._size(self._grid)

    def snapshot(self, number: int, now: GraphSnapshot) -> GraphSnapshot | None:
        """Return state `number` as the newest of a snapshot; None if it is not kept.

        Its forecast was made for this state. `now` gives rig and start.
        """
        with self._lock:
            grid = self._grid
            if self._file is None or grid is None or not self._first <= number <= self._last:
                return None
            content = os.pread(self._file.fileno(), self._size(grid), self._place_of(number))
        head = json_value(content[:_HEAD])
        maps = np.frombuffer(content[_HEAD:], dtype=_STORED).reshape(_MAPS, *grid.shape)
        observed, forecast, difference = (
            None if np.isnan(values).all() else values for values in maps.astype(float)
        )
        unseen = np.full(grid.shape, np.nan)
        shown = Map(head['time'], unseen if observed is None else observed, grid, head['number'])
        forecasts = () if forecast is None else (Map(shown.time, forecast, grid, shown.number),)
        rates = {well: WellRate(*pair) for well, pair in head['rates'].items()}
        unknown = (math.nan, math.nan, math.nan, math.nan)
        return GraphSnapshot(
            rig=now.rig,
            observed=ObservedState(head['sequence'], shown, arrival=0.0),
            predicted=() if head['is_corrected_map'] else forecasts,
            corrected=forecasts if head['is_corrected_map'] else (),
            difference=difference,
            setpoints=(Setpoint(0, shown.time, shown.time, rates, ''),) if rates else (),
            history=(CyclePoint(shown.time, *unknown, corrected=head['corrected']),),
            start=now.start,
        )

    def _close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def close(self) -> None:
        """Drop all states and their file."""
        with self._lock:
            self._close()
