"""An experiment on the virtual rig, written as an experiment folder."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.model.held_out_share import held_out_begin
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.wells import Schedule
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.tables.concentration import VIRTUAL, ConcentrationWriter, MapOrigin
from porotwin_recording.tables.photos import Photo, write_photos
from porotwin_recording.tables.recorded_data import RecordedData
from porotwin_rig.camera import ASPECT, camera_before
from porotwin_rig.camera_signal import signal_seen
from porotwin_rig.map_camera import MapCamera, MapNoise
from porotwin_rig.render import Photographer
from porotwin_rig.virtual_rig import VirtualRig

PERFECT = MapNoise(grain=0.0, frame=0.0, blur_cells=0.0)
"""An image analysis that returns the signal as it is."""

ORIGIN = MapOrigin(program=f'{PROGRAM}, {VIRTUAL}')
"""What the file of the maps says of them: they do not come from its photographs."""


@dataclass(frozen=True)
class MadeExperiment:
    """Facts about a simulated experiment.

    Args:
        times: times of the frames [s].
        noise_floor: relative L2 norm, over the last 30 % of the time, of the difference between the
            maps and the signal.
        injected: volume of tracer stock injected [m^3].
        removed: volume of tracer stock removed [m^3].
    """

    times: tuple[float, ...]
    noise_floor: float
    injected: float
    removed: float


class NoiseFloor:
    """The relative L2 norm [-] of map minus signal: sqrt(sum (map - signal)^2 / sum signal^2)."""

    def __init__(self) -> None:
        self._difference = 0.0
        self._signal = 0.0

    def add(self, seen: FloatArray, signal: FloatArray) -> None:
        """Add a frame: the map `seen` and its `signal`, (nz, nx) [-] each."""
        self._difference += float(np.sum((seen - signal) ** 2))
        self._signal += float(np.sum(signal**2))

    @property
    def value(self) -> float:
        """The norm [-]; 0 without any signal."""
        return float(np.sqrt(self._difference / self._signal)) if self._signal > 0.0 else 0.0


def signals(
    rig: VirtualRig,
    commanded: Schedule,
    *,
    times: Iterable[float],
    grid: Grid,
    passed: Callable[[float], None] = lambda _time: None,
) -> Iterator[tuple[float, FloatArray]]:
    """Yield (time, signal (nz, nx)) of photographs at ascending `times` [s] while `rig` runs.

    The photograph stamped t shows the rig at pump time t + `rig.clock_offset`. `passed` is called
    with the pump time [s] after every step of the rig.

    Raises:
        InputError: a well of the schedule is not known.
    """
    for time in times:
        until = max(time + rig.clock_offset, 0.0)
        for start, end, rates in commanded.intervals(rig.time, until):
            rig.set_rates(rates)
            rig.advance(end - start, passed)
        yield time, signal_seen(rig, grid, time=time)


def make_experiment(
    folder: Path,
    asset: VirtualRig,
    *,
    commanded: Schedule,
    duration: float,
    photo_interval: float,
    seed: int,
    noise: MapNoise | None = None,
    grid: Grid | None = None,
    photo_width_px: int | None = None,
    truth: Path | None = None,
    progress: Callable[[float], None] = lambda _share: None,
) -> MadeExperiment:
    """Run an experiment and write it into `folder`; the folder does not name the effects.

    Args:
        folder: the experiment folder; must not hold an experiment yet.
        asset: the virtual rig before its start; its nominal rig is written as it is.
        commanded: the commanded rates, which run with the pauses and levels that the rig announces;
            later ones than the duration are left out.
        duration: length of the experiment [s].
        photo_interval: time between frames [s], the first at 0.
        seed: seed of the noise, and of the photographs.
        noise: noise of the maps; None for a perfect camera, whose maps are kept unpacked.
        grid: grid of the maps; cells of about 5 mm by default.
        photo_width_px: width of photographs (8:5); None for no photographs.
        truth: file for the noise-free signal at the times of the frames, outside `folder`.
        progress: called with the share of the experiment that is done, 0 to 1, after every step of
            the virtual rig. A slow rig with a dense tracer takes steps of 15 s over days.

    Raises:
        InputError: the folder is in use, or a well or a time is wrong.
    """
    if not (duration > 0.0 and photo_interval > 0.0):
        raise InputError(f'duration {duration} s, photo interval {photo_interval} s: give positive')
    rig = asset.rig
    grid = grid or rig.default_grid()
    commanded = FixedPauses.of(rig).in_schedule(commanded)  # as whoever reads the folder will
    photographer = None
    if photo_width_px is not None:
        camera = camera_before(rig, photo_width_px, round(photo_width_px * ASPECT))
        photographer = Photographer(rig, camera=camera, seed=seed)
        rig = photographer.rig
    rows = tuple(row for row in commanded.rows if row.time <= duration)
    write_folder(folder, RecordedData(rig, commanded=replace(commanded, rows=rows)))
    camera_of_maps = MapCamera(grid, noise or PERFECT, seed=seed)
    times = [
        n * float(photo_interval) for n in range(int(duration / photo_interval + ROUND_OFF) + 1)
    ]
    photos: list[Photo] = []
    if photographer is not None:
        photos.append(_stored(folder, 'baseline', 0.0, photographer.baseline()))
    floor = NoiseFloor()
    packed, file = noise is not None, folder / 'concentration.nc'
    with (
        ConcentrationWriter(file, grid, packed=packed, origin=ORIGIN) as maps,
        ConcentrationWriter(truth, grid) if truth else nullcontext() as clean,
    ):
        fine = grid if photographer is None else grid.refined(2)
        seen_by_camera = signals(
            asset,
            commanded,
            times=times,
            grid=fine,
            passed=lambda time: progress(min(time / duration, 1.0)),
        )
        for number, (time, visible) in enumerate(seen_by_camera):
            signal = conservative_resample(visible, grid.shape)
            seen = signal if noise is None else camera_of_maps.map(signal, number)
            maps.append(time, seen)
            if clean is not None:
                clean.append(time, signal)
            if photographer is not None and number > 0:
                jpeg = photographer.photograph(visible, time=time)
                photos.append(_stored(folder, 'state', time, jpeg))
            if time >= held_out_begin(0.0, duration):
                floor.add(seen, signal)
    if photos:
        write_photos(folder, photos)
    return MadeExperiment(tuple(times), floor.value, asset.balance.injected, asset.balance.removed)


def _stored(folder: Path, role: Literal['baseline', 'state'], time: float, jpeg: bytes) -> Photo:
    """Write a photograph at once, so that memory does not grow with their number."""
    name = f'photos/{role}_{round(time):06d}.jpg'
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(jpeg)
    return Photo(time, role, name, path.read_bytes, path)
