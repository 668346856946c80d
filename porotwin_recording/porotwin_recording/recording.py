"""A recording as everything that reads one sees it, whether a folder or a bag holds it."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig, load_rig
from porotwin_core.wells import Schedule
from porotwin_recording.bag_reader import is_bag
from porotwin_recording.bag_recording import read_bag
from porotwin_recording.concentration import ConcentrationMaps, Maps
from porotwin_recording.experiment import read_experiment
from porotwin_recording.photos import Photo


@dataclass(frozen=True)
class Recording:
    """One experiment: the rig as its owner believes it to be, what was told, what was seen.

    `told` is what the pumps were told, `measured` what they delivered, where somebody measured it;
    `maps` the tracer maps, read from disk as they are asked for; `photos` in the order of their
    times. Times in [s] since the start of the experiment. None or empty where the recording holds
    nothing of the kind; `schedule`, `pumped`, `times`, `grid` and `concentration` insist. `remarks`
    says in a line each what is wrong with a recording that could be read all the same.
    """

    source: Path
    rig: Rig
    told: Schedule | None = None
    measured: Schedule | None = None
    maps: ConcentrationMaps | None = None
    photos: tuple[Photo, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def schedule(self) -> Schedule:
        """What the pumps were told.

        Raises:
            InputError: the recording does not say.
        """
        if self.told is None:
            raise InputError(f'{self.source}: does not say what the pumps were told; add rates.csv')
        return self.told

    @cached_property
    def pumped(self) -> Schedule:
        """What the pumps did: as measured, and before anybody measured as told.

        Raises:
            InputError: the recording does not say.
        """
        if self.measured is None or not self.measured.rows:
            return self.schedule
        begin = min(row.time for row in self.measured.rows)
        told = self.told.rows if self.told is not None else ()
        return Schedule((*(row for row in told if row.time < begin), *self.measured.rows))

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the tracer maps [s], shape (nt,)."""
        return self._maps.times

    @property
    def grid(self) -> Grid:
        """Grid of the tracer maps."""
        return self._maps.grid

    @cached_property
    def concentration(self) -> Maps:
        """All tracer maps in memory, float32, shape (nt, nz, nx); prefer `maps` for long runs."""
        return self._maps[:]

    @property
    def _maps(self) -> ConcentrationMaps:
        if self.maps is None:
            raise InputError(
                f'{self.source}: holds no concentration maps; make them with ./porotwin image'
            )
        return self.maps


def open_recording(path: Path | str, *, rig: Rig | Path | str | None = None) -> Recording:
    """Return the recording at `path`: an experiment folder, a rosbag2 folder or an .mcap file.

    A given `rig` (or the path of a rig.yaml) takes the place of the one in the recording.

    Raises:
        InputError: one line naming the recording, what is wrong with it and what would mend it.
    """
    path = Path(path)
    if isinstance(rig, Path | str):
        rig = load_rig(rig)
    if not path.exists():
        raise InputError(f'{path}: no such recording; name an experiment folder or an MCAP bag')
    is_folder = path.is_dir() and ((path / 'rig.yaml').is_file() or not is_bag(path))
    experiment = read_experiment(path, rig) if is_folder else read_bag(path, rig)
    return Recording(
        path,
        experiment.rig,
        experiment.told,
        experiment.measured,
        experiment.maps,
        experiment.photos,
        experiment.remarks,
    )
