"""Maps of a long work: written in parts that no kill can harm, and joined at the end.

Every part is a complete file. A kill therefore costs the maps of the part that is being written,
and never those before it. (One file that grows may be unreadable after a kill, because the NetCDF
library writes its index in several steps.)
"""

import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from numpy.typing import NDArray

from porotwin_core.basis.errors import write_error
from porotwin_core.basis.json_text import json_value
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_recording.tables.concentration import (
    MAPS_AT_ONCE,
    UNKNOWN_ORIGIN,
    ConcentrationMaps,
    ConcentrationWriter,
    MapOrigin,
    open_maps,
)
from porotwin_recording.tables.map_writer import check_next

_SOURCE = 'source.json'
"""File beside the parts that tells their source."""


class MapParts:
    """Writes maps in parts beside the file `path`, which appears when all are joined.

    Use it like `ConcentrationWriter`. After an interruption, a writer with the same `source`,
    origin and grid goes on behind the last complete part. Parts of another source are removed.

    Args:
        path: the file of all maps.
        rig: the rig.
        grid: the grid of the maps.
        source: what the maps are made from, as a hash or in words, by name.
        origin: how the maps were made.

    Attributes:
        earlier: times of the maps that an interrupted writer left [s].
        changed: names of what differs from the source of maps that were removed; empty: none were.

    Raises:
        InputError: the parts cannot be written.
    """

    def __init__(
        self,
        path: Path,
        rig: Rig,
        grid: Grid,
        *,
        source: Mapping[str, str],
        origin: MapOrigin = UNKNOWN_ORIGIN,
    ) -> None:
        self.path = path
        self._rig, self._grid, self._origin = rig, grid, origin
        self._folder = path.with_name(f'{path.name}.parts')
        self._part: ConcentrationWriter | None = None
        self._in_part = 0
        self.changed: tuple[str, ...] = ()
        self._begin_or_go_on({**source, 'calibration or program': str(origin), 'grid': str(grid)})
        self.earlier = tuple(float(time) for part in self._parts() for time in part.times)
        self._last = max(self.earlier, default=-math.inf)

    def _begin_or_go_on(self, source: Mapping[str, str]) -> None:
        mark = self._folder / _SOURCE
        try:
            before = _source_in(mark)
            if before != source:
                if self._files():
                    self.changed = tuple(key for key in source if before.get(key) != source[key])
                shutil.rmtree(self._folder, ignore_errors=True)
                self._folder.mkdir()
                mark.write_text(json.dumps(source), encoding='utf-8')
        except OSError as error:
            raise write_error(self.path, error) from None

    def _files(self) -> list[Path]:
        """Return the complete parts in their order."""
        return sorted(self._folder.glob('*.nc'))

    def _parts(self) -> list[ConcentrationMaps]:
        return [open_maps(file, self._rig) for file in self._files()]

    def append(
        self,
        time: float,
        concentration: NDArray,
        *,
        deviation: NDArray | None = None,
        systematic: NDArray | None = None,
    ) -> None:
        """Write the map (nz, nx) [-] at `time` [s]; see `ConcentrationWriter.append`.

        Raises:
            InputError: as there.
        """
        check_next(self.path, time, self._last)
        if self._part is None:
            file = self._folder / f'{len(self._files()):06d}.nc'
            self._part = ConcentrationWriter(file, self._grid, origin=self._origin)
        self._part.append(time, concentration, deviation=deviation, systematic=systematic)
        self._last, self._in_part = time, self._in_part + 1
        if self._in_part == MAPS_AT_ONCE:
            self._end_part()

    def _end_part(self) -> None:
        if self._part is None:
            return
        if self._in_part:
            self._part.close()
        else:
            self._part.discard()
        self._part, self._in_part = None, 0

    def close(self) -> None:
        """Join all parts to the file."""
        self._end_part()
        files = self._files()
        if len(files) == 1:
            files[0].replace(self.path)
        else:
            with ConcentrationWriter(self.path, self._grid, origin=self._origin) as whole:
                for part in self._parts():
                    for time, fields in zip(part.times, part.with_deviations(), strict=True):
                        values, deviation, systematic = fields
                        whole.append(time, values, deviation=deviation, systematic=systematic)
        shutil.rmtree(self._folder)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
            return
        self._end_part()
        if not self._files():
            shutil.rmtree(self._folder)


def _source_in(mark: Path) -> dict[str, Any]:
    """Return the source in the file `mark`; empty if there is none that can be read."""
    try:
        found = json_value(mark.read_text(encoding='utf-8'))
    except (FileNotFoundError, ValueError):  # torn by a kill
        return {}
    return found if isinstance(found, dict) else {}
