"""An experiment on the virtual rig, written as a laboratory would keep it."""

from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.wells import Schedule
from porotwin_recording.concentration import ConcentrationWriter
from porotwin_recording.experiment_folder import write_folder
from porotwin_recording.photos import Photo, write_photos
from porotwin_recording.recorded_data import RecordedData
from porotwin_rig.asset import VirtualRig
from porotwin_rig.camera import camera_before
from porotwin_rig.observation import MapCamera, MapNoise, signal_seen
from porotwin_rig.pumps import Pumps
from porotwin_rig.render import Conditions, Photographer

_PERFECT = MapNoise(grain=0.0, frame=0.0, blur_cells=0.0)


@dataclass(frozen=True)
class MadeExperiment:
    """What is known of an experiment that was made.

    `times` [s] of the frames kept; `noise_floor`: relative L2 norm, over the last 30 % of the time,
    of what the camera did to the signal beyond its effects; `injected`, `removed`: volumes of
    tracer stock [m^3].
    """

    times: tuple[float, ...]
    noise_floor: float
    injected: float
    removed: float


def signals(
    rig: VirtualRig, told: Schedule, *, times: Iterable[float], grid: Grid
) -> Iterator[tuple[float, FloatArray]]:
    """Yield (time, signal (nz, nx)) for photographs at ascending `times` [s] while `rig` runs.

    With a `clock` effect the photograph stamped t shows the rig at pump time t + offset.
    """
    offset = rig.effects.number('clock', 'offset')
    for time in times:
        for start, end, rates in told.intervals(rig.time, max(time + offset, 0.0)):
            rig.set_rates(rates)
            rig.advance(end - start)
        yield time, signal_seen(rig, grid, time=time)


def make_experiment(
    folder: Path,
    rig: Rig,
    *,
    told: Schedule,
    duration: float,
    photo_interval: float,
    seed: int,
    effects: Iterable[EffectDescription] = (),
    noise: MapNoise | None = None,
    pumps: Pumps | None = None,
    grid: Grid | None = None,
    photo_width: int | None = None,
    conditions: Conditions | None = None,
    truth: Path | None = None,
) -> MadeExperiment:
    """Run an experiment of `duration` [s] and write it into `folder`; effects stay untold.

    Args:
        rig: as its owner believes it to be; written as it is.
        told: what the pumps are told.
        photo_interval: time between frames [s], the first at 0.
        effects: what the rig and its camera truly do beside it.
        noise: of the maps; None for a perfect camera, whose maps are then kept unpacked.
        pumps: what they deliver of what they are told; by default all of it.
        grid: of the maps; about 5 mm cells by default.
        photo_width: width in pixels of photographs (3:2 or so) to be taken as well; None: none.
        conditions: under which those are taken.
        truth: a file beside the folder for the signal without noise at the frames' times.

    Raises:
        InputError: the folder is in use, or an effect, a well or a time is wrong.
    """
    if not (duration > 0.0 and photo_interval > 0.0):
        raise InputError(f'duration {duration} s, photo interval {photo_interval} s: give positive')
    grid = grid or rig.default_grid()
    asset = VirtualRig(rig, effects=effects, pumps=pumps)
    photographer = None
    if photo_width is not None:
        camera = camera_before(rig, photo_width, round(photo_width * 0.625))
        photographer = Photographer(rig, camera=camera, conditions=conditions, seed=seed)
        rig = photographer.rig
    write_folder(folder, RecordedData(rig, commanded=told))
    camera_of_maps = MapCamera(grid, noise or _PERFECT, seed=seed)
    times = [n * float(photo_interval) for n in range(int(duration / photo_interval + 1e-9) + 1)]
    photos: list[Photo] = []
    if photographer is not None:
        photos.append(_stored(folder, 'baseline', 0.0, photographer.baseline()))
    kept, disturbed, signal_norm = [], 0.0, 0.0
    with (
        ConcentrationWriter(folder / 'concentration.nc', grid, packed=noise is not None) as maps,
        ConcentrationWriter(truth, grid) if truth else nullcontext() as clean,
    ):
        fine = grid if photographer is None else grid.refined(2)
        for number, (time, visible) in enumerate(signals(asset, told, times=times, grid=fine)):
            if camera_of_maps.is_lost(number):
                continue
            signal = conservative_resample(visible, grid.shape)
            seen = signal if noise is None else camera_of_maps.map(signal, number)
            maps.append(time, seen)
            if clean is not None:
                clean.append(time, signal)
            if photographer is not None and number > 0:
                photos.append(
                    _stored(folder, 'state', time, photographer.photograph(visible, time=time))
                )
            if time >= 0.7 * duration:
                disturbed += float(np.nansum((seen - signal) ** 2))
                signal_norm += float(np.sum(np.where(np.isfinite(seen), signal, 0.0) ** 2))
            kept.append(time)
    if photos:
        write_photos(folder, photos)
    return MadeExperiment(
        tuple(kept),
        float(np.sqrt(disturbed / signal_norm)) if signal_norm > 0.0 else 0.0,
        asset.injected,
        asset.removed,
    )


def _stored(folder: Path, role: Literal['baseline', 'state'], time: float, jpeg: bytes) -> Photo:
    """Write a photograph at once, so that memory does not grow with their number."""
    name = f'photos/{role}_{round(time):06d}.jpg'
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(jpeg)
    return Photo(time, role, name, path.read_bytes, path)
