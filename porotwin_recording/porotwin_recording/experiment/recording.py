"""A recording of one experiment, whether a folder or a bag holds it."""

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from porotwin_checks.all_checks import CHECKS, OF_TABLES, remarks_about
from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig, load_rig
from porotwin_recording.experiment.bag import read_bag
from porotwin_recording.experiment.dataset_variables import as_xarray
from porotwin_recording.experiment.experiment_folder import (
    MAPS_FILE,
    RIG_FILE,
    is_experiment,
    read_folder,
)
from porotwin_recording.tables.concentration import ConcentrationMaps, Maps
from porotwin_recording.tables.map_files import files_with_maps
from porotwin_recording.tables.recorded_data import RecordedData

if TYPE_CHECKING:
    import xarray

LOG = logging.getLogger('porotwin')


@dataclass(frozen=True, kw_only=True)
class Recording(RecordedData):
    """The data of one experiment and the place they come from.

    The attributes of `RecordedData` are None or empty where the recording lacks something. The
    properties `schedule`, `delivered`, `times`, `grid` and `concentration` raise InputError then.
    """

    source: Path

    @property
    def schedule(self) -> Schedule:
        """Commanded rates.

        Raises:
            InputError: the recording holds none.
        """
        if self.commanded is None:
            raise InputError(f'{self.source}: holds no commanded pump rates; add rates.csv')
        return self.commanded

    @cached_property
    def delivered(self) -> Schedule:
        """The known rates.

        Raises:
            InputError: the recording holds neither measured nor commanded ones.
        """
        return self.schedule if self.known_rates is None else self.known_rates

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the tracer maps [s], shape (nt,).

        Raises:
            InputError: the recording holds no maps.
        """
        return self.present_maps.times

    @property
    def grid(self) -> Grid:
        """Grid of the tracer maps.

        Raises:
            InputError: the recording holds no maps.
        """
        return self.present_maps.grid

    @cached_property
    def concentration(self) -> Maps:
        """All tracer maps in memory, float32, shape (nt, nz, nx); prefer `maps` for long runs.

        Raises:
            InputError: the recording holds no maps.
        """
        return self.present_maps[:]

    @property
    def present_maps(self) -> ConcentrationMaps:
        """The tracer maps.

        Raises:
            InputError: the recording holds none; the line names the file that is expected.
        """
        if self.maps is None:
            raise InputError(f'{self.source}: holds no concentration maps; {self._maps_remedy()}')
        return self.maps

    def to_xarray(self) -> 'xarray.Dataset':
        """Return maps, rates and wells as an `xarray.Dataset` with units, as `export` writes them.

        Raises:
            InputError: the recording holds no maps, or xarray is not installed.
        """
        return as_xarray(self, self.present_maps, self.source.name)

    def _repr_html_(self) -> str:
        """Return the contents as a table, for notebooks."""
        rows = {
            'source': str(self.source),
            'rig': self.rig.name,
            'rates': 'measured' if self.measured is not None else 'commanded',
            'photographs': str(len(self.photos)),
        }
        if self.commanded is None and self.measured is None:
            del rows['rates']
        if self.maps is not None:
            first, last = self.times[[0, -1]]
            rows['maps'] = f'{len(self.times)}, {first:g} to {last:g} s, {self.grid}'
        lines = (f'<tr><th>{name}</th><td>{escape(text)}</td></tr>' for name, text in rows.items())
        return f'<table>{"".join(lines)}</table>'

    def _maps_remedy(self) -> str:
        """Return how to give the recording maps."""
        make = './porotwin image {0} --output {0}/' + MAPS_FILE
        if not is_experiment(self.source):
            return (
                f'./porotwin export {self.source} FOLDER makes a folder of it, and '
                f'{make.format("FOLDER")} the maps'
            )
        ways = [f'make them with {make.format(self.source)}'] if self.photos else []
        if self.remarks:
            return self.remarks[0]
        if found := files_with_maps(self.source):
            ways.insert(0, f'if {" or ".join(found)} holds them, name it {MAPS_FILE}')
        return ', or '.join(ways) or f'write them as {self.source / MAPS_FILE}'


def open_recording(
    path: Path | str, *, rig: Rig | Path | str | None = None, segment: int | None = None
) -> Recording:
    """Return the recording at `path`: an experiment folder, a rosbag2 folder or an .mcap file.

    Args:
        path: the recording; the rig.yaml of an experiment folder means the folder.
        rig: a rig, or the path of a rig.yaml, that replaces the one of the recording.
        segment: number of the experiment in a bag that holds several, from 1; see `read_bag`.

    Raises:
        InputError: one line that names the recording, the fault and the remedy.
    """
    path = Path(path)
    if isinstance(rig, Path | str):
        rig = load_rig(rig)
    if not path.exists():
        raise InputError(f'{path}: no such recording; name an experiment folder or an MCAP bag')
    if path.name == RIG_FILE and path.is_file():  # the folder is meant
        path = path.parent
    is_folder = is_experiment(path)
    if is_folder and segment not in (None, 1):
        raise InputError(f'{path}: a folder holds one experiment; leave the segment away')
    data = read_folder(path, rig) if is_folder else read_bag(path, rig, segment=segment)
    recording = Recording(source=path, **vars(data))
    if not is_folder:  # read_folder has told them
        for line in odd_lines([recording], OF_TABLES):
            LOG.warning(line)
    tell_other_rig(path, data.rig, data.replaced_rig)
    return recording


def odd_lines(
    recordings: Iterable[Recording], checks: Mapping[str, Check[Known]] = CHECKS
) -> list[str]:
    """Return a line for all that `checks` find odd in `recordings`."""
    return [
        f'{recording.source}: {remark}'
        for recording in recordings
        for remark in remarks_about(recording.known(), checks)
    ]


def tell_other_rig(path: Path, used: Rig, own: Rig | None) -> None:
    """Log the keys that differ between the `used` rig and the `own` one of the data at `path`."""
    if own is not None and (keys := used.keys_that_differ(own)):
        LOG.warning('%s: read with another rig.yaml, which differs in %s', path, ', '.join(keys))
