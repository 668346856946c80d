"""The data of an experiment for the checks."""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import MINUTE_S
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.gauge_reading import GaugeReading
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_solver.effects import tracer_storage
from porotwin_solver.model.rates_into_sand import rates_into_sand

MOST_MAPS = 24
"""Maps that a check looks at, evenly spread, where it need not see all."""


class Maps(Protocol):
    """Maps (nz, nx) in the order of their times, with NaN where nothing is known [-]."""

    def __getitem__(self, number: int, /) -> NDArray[Any]: ...
    def __iter__(self) -> Iterator[NDArray[Any]]: ...


class ListedPhoto(Protocol):
    """A line of `imaging.csv`: time [s], name and role of a photograph."""

    @property
    def time(self) -> float: ...
    @property
    def name(self) -> str: ...
    @property
    def role(self) -> str: ...


class PhotoFile(NamedTuple):
    """The file of a photograph.

    name: of the photograph; size: width and height [px], None if it is no picture; is_cut: it ends
    before its picture; digest: of its bytes, empty where it could not be read.
    """

    name: str
    size: tuple[int, int] | None
    is_cut: bool
    digest: bytes


@dataclass(frozen=True, kw_only=True)
class Known:
    """The known data of an experiment; None or empty where nothing is known.

    A check names in `needs` the attributes without which it is not asked, and sees no others as
    known. Its needs also tell who asks it:

    - `maps` or `scaled_maps`: whoever evaluates maps, such as `image`, `measure` and `diagnose`;
    - `seen_photos`: whoever reads photographs, which are `check`, `image` and `calibrate`;
    - `rig`, which is always known: `check`, `import`, `image`, `calibrate`, `diagnose`, and whoever
      starts a twin. These are questions that a rig alone can answer;
    - all others: whoever opens a recording.

    Attributes:
        rig: its description.
        commanded: rates that the pumps should deliver.
        measured: rates that they delivered, where somebody measured them.
        pumped: the delivered rates as far as they are known: measured, else commanded.
        times: times of the maps [s], ascending, (nt,).
        maps: the maps; None where they are not to be opened.
        scaled_maps: the maps, if their concentrations may be right; None if nothing calibrated
            them.
        photos: the listed photographs, ordered by time.
        names: a name for each map, such as its photograph; empty: they are named by their times.
        readings: of balances and manometers, ordered by time.
        seen_photos: files of photographs, in their order, where somebody read them.
        chosen_cells: grid of predictions; None: the usual one of the rig.
    """

    rig: Rig
    commanded: Schedule | None = None
    measured: Schedule | None = None
    pumped: Schedule | None = None
    times: Sequence[float] | FloatArray = ()
    maps: Maps | None = None
    scaled_maps: Maps | None = None
    photos: Sequence[ListedPhoto] = ()
    names: Sequence[str] = ()
    readings: Sequence[GaugeReading] = ()
    seen_photos: Sequence[PhotoFile] = ()
    chosen_cells: Grid | None = None

    def has(self, name: str) -> bool:
        """Return whether the attribute `name` is known, and not empty."""
        value = getattr(self, name)
        if isinstance(value, Rig):
            return True
        if isinstance(value, Schedule):
            return bool(value.rows)
        return value is not None and len(self.times if name.endswith('maps') else value) > 0

    @cached_property
    def rates(self) -> Schedule | None:
        """The `pumped` rates as they reach the sand by the effects of `rig`; None: not known.

        Refused effects change nothing here: who uses the model tells them.
        """
        with contextlib.suppress(InputError):
            return None if self.pumped is None else rates_into_sand(self.rig, self.pumped)
        return self.pumped

    def name_of(self, number: int) -> str:
        """Return the name of a map by its `number`."""
        return self.names[number] if self.names else f'the map at {self.times[number]:.0f} s'

    @property
    def end(self) -> float:
        """The last known time [s] of a recording; the end of the experiment of a plan, or of a rig.

        A plan is rates without maps, photographs and measured rates. Whoever runs it stops at
        `control.end_min`, whatever rows come later.
        """
        control = self.rig.control
        is_recorded = self.has('times') or self.photos or self.has('measured')
        if not is_recorded and control is not None and control.end_min is not None:
            return MINUTE_S * control.end_min
        tables = [rates.rows for rates in (self.commanded, self.measured) if rates is not None]
        times = [0.0, *(row.time for rows in tables for row in rows), *map(float, self.times[-1:])]
        return max([*times, *(photo.time for photo in self.photos)])

    @property
    def grid(self) -> Grid:
        """The grid of the maps."""
        assert self.maps is not None
        return self.rig.grid(*self.maps[0].shape[::-1])

    @property
    def cells(self) -> Grid:
        """The grid of predictions."""
        return self.chosen_cells or self.rig.default_grid()

    @property
    def looked_at(self) -> list[int]:
        """Numbers of at most `MOST_MAPS` maps, evenly spread to both ends."""
        count = min(len(self.times), MOST_MAPS)
        spread = np.linspace(0, len(self.times) - 1, count).round().astype(int)
        numbers: list[int] = spread.tolist()
        return numbers


def stock_in_map(values: FloatArray, rig: Rig) -> float:
    """Return the volume of stock [m^3] in a map of concentration (nz, nx) [-].

    NaN counts as 0, and so does what shows above the water.
    """
    rows, columns = values.shape
    grid = rig.grid(columns, rows)
    return float(np.nansum(np.where(rig.wet_sand(grid), values * tracer_storage(rig, grid), 0.0)))
