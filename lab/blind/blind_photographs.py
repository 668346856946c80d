"""Blinded cases seen by a camera: photographs of the virtual rig become a recording with maps.

    photographs -> a known injection on the same flawed rig calibrates -> maps with their deviations

The rig has the hidden effects in both experiments. All that the camera, the calibration and the
imaging leave behind is therefore in the maps. The photographs are rendered, or composed on the
baseline photograph of a real rig.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from lab.blind.blind_cases import BlindCase
from lab.blind.case_progress import Share, no_share, part_of
from lab.photographs.dyed_sand import DyedSand, Shot, sands_of
from lab.photographs.known_injection import fit_of_injection
from lab.photographs.photo_cases import baseline_of, drawn_dye, drawn_shots
from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import Role
from porotwin_core.basis.units import DAY_S, from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused
from porotwin_imaging.calibrating.sand_refinement import refined
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.photograph.file_hash import sha256_of_file
from porotwin_imaging.tracer.calibration import Calibration, save_calibration
from porotwin_recording.experiment.experiment_folder import folder_data, write_folder
from porotwin_recording.tables.concentration import ConcentrationWriter, MapOrigin
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData
from porotwin_rig.camera import ASPECT, camera_before
from porotwin_rig.made_experiment import signals
from porotwin_rig.render import Conditions, Photographer

PHOTO_WIDTH_PX = 1000
"""Width of rendered photographs [px]: 5 pixels for a cell of 5 mm, and quick to make."""

LEAST_FINER = 2
"""Photographed cells per cell of the maps, each way, at least: a map knows no sharper front."""

INJECTIONS_M = 0.12
"""Radius of the plume that a calibration injects into each well [m], on the paper's small rig; the
plume grows with the rig."""

CALIBRATION_PHOTOGRAPHS = 9
"""Photographs of the injection for a calibration, beside the baseline."""

MOST_SHIFT_PX, MOST_TURN_RAD = 3.0, 0.002
"""Displacement [px at 1600 px width] and rotation of the camera after a baseline, at most."""

CORNER_ERROR = 3e-4
"""Standard deviation of a corner that a person reads off a photograph, relative to its width."""

RECORDING, INJECTION, CALIBRATION = 'recording', 'injection', 'calibration.yaml'
"""Names within the folder of a case: both experiments, and the calibration made from the second."""

REFUSED = 'refused.txt'
"""File with the reason why no maps were made, in the folder of a case."""


class CaseCamera(Protocol):
    """Takes the photographs of one experiment; another experiment has its own light and shake."""

    def baseline(self) -> bytes:
        """Return the file of a photograph without tracer."""

    def photograph(self, signal: FloatArray, time: float) -> bytes:
        """Return the file of a photograph of `signal` (nz, nx) [-] at `time` [s]."""


class CameraRoom(Protocol):
    """A camera in front of a rig.

    Attributes:
        told: the rig with the `camera` section that its owner wrote.
    """

    told: Rig

    def camera(self, experiment: int, duration: float) -> CaseCamera:
        """Return the camera of the experiment of this number, which lasts `duration` [s]."""


class RenderedRoom:
    """The virtual rig's own scene and camera, with all of their disturbances."""

    def __init__(self, case: BlindCase, width_px: int = PHOTO_WIDTH_PX) -> None:
        self._rig, self._seed = case.rig, case.seed
        self._camera = camera_before(case.rig, width_px, round(width_px * ASPECT))
        described = case.rig.model_copy(update={'camera': self._camera.description()})
        self.told = with_read_corners(described, width_px, case.seed)

    def camera(self, experiment: int, duration: float) -> CaseCamera:  # noqa: ARG002  protocol
        """Return a camera that was displaced a little after its baseline."""
        generator = np.random.default_rng([self._seed, 31, experiment])
        right, down = generator.uniform(-MOST_SHIFT_PX, MOST_SHIFT_PX, 2)
        conditions = Conditions(
            shift_px=(float(right), float(down)),
            rotation_rad=float(generator.uniform(-MOST_TURN_RAD, MOST_TURN_RAD)),
        )
        photographer = Photographer(
            self._rig, camera=self._camera, conditions=conditions, seed=self._seed
        )
        return _Rendered(photographer, start=experiment * DAY_S)


@dataclass(frozen=True)
class _Rendered:
    photographer: Photographer
    start: float

    def baseline(self) -> bytes:
        return self.photographer.baseline(time=self.start)

    def photograph(self, signal: FloatArray, time: float) -> bytes:
        return self.photographer.photograph(signal, time=self.start + time)


class ComposedRoom:
    """Tracer in the sand of a real baseline photograph.

    Raises:
        InputError: `folder` has no readable baseline photograph.
    """

    def __init__(self, case: BlindCase, folder: Path) -> None:
        self._seed = case.seed
        true, baseline = baseline_of(folder)
        dye = drawn_dye(true, np.random.default_rng([case.seed, 32]))
        self._scene = DyedSand(true, baseline, sands_of(true, baseline), dye)
        self.told = with_read_corners(true, baseline.shape[1], case.seed)

    def camera(self, experiment: int, duration: float) -> CaseCamera:
        """Return a camera that shakes, below lamps that drift."""
        generator = np.random.default_rng([self._seed, 33, experiment])
        shots = tuple(drawn_shots(SHOTS, generator))
        return _Composed(self._scene, shots, duration, (self._seed, experiment))


SHOTS = 200
"""Poses and lights over an experiment, more than it has photographs."""


@dataclass(frozen=True)
class _Composed:
    scene: DyedSand
    shots: Sequence[Shot]
    duration: float
    seed: tuple[int, int]

    def baseline(self) -> bytes:
        return self.scene.photograph(np.zeros((2, 2)), Shot(), seed=(*self.seed, 0))

    def photograph(self, signal: FloatArray, time: float) -> bytes:
        number = min(int(len(self.shots) * time / self.duration), len(self.shots) - 1)
        seed = (*self.seed, 1 + round(time))
        return self.scene.photograph(np.clip(signal, 0.0, 1.0), self.shots[number], seed=seed)


def with_read_corners(rig: Rig, width_px: int, seed: int) -> Rig:
    """Return `rig` with the corners as a person reads them off a photograph of `width_px`."""
    if rig.camera is None:
        raise InputError(f"rig '{rig.name}' has no camera; add camera to rig.yaml")
    errors = np.random.default_rng([seed, 34]).normal(0.0, CORNER_ERROR * width_px, (4, 2))
    read = np.round(np.array(rig.camera.corners_px) + errors, 2)
    corners = tuple((float(column), float(row)) for column, row in read)
    return rig.model_copy(update={'camera': rig.camera.model_copy(update={'corners_px': corners})})


def photograph_case(
    case: BlindCase,
    folder: Path,
    *,
    clean: Path,
    baseline: Path | None = None,
    progress: Share = no_share,
) -> None:
    """Write the recording of `case` with maps from photographs into `folder`.

    Complete maps are kept. The recording holds only the knowledge of a laboratory.

    Args:
        case: the case.
        folder: folder of the case; gets the recording, the injection and the calibration.
        clean: file for the maps without noise.
        baseline: experiment folder with the baseline photograph of a real rig, which is then the
            rig of `case`; None renders the photographs.
        progress: called with the share of the work that is done.

    Raises:
        CalibrationRefused: the calibration cannot be trusted; `REFUSED` holds the reason.
        InputError: an effect is impossible, or a photograph cannot be used.
    """
    if (folder / RECORDING / MAPS).exists():
        return
    room = RenderedRoom(case) if baseline is None else ComposedRoom(case, baseline)
    grid = case.rig.default_grid(case.cell_m)
    times = np.arange(0.0, case.duration + 1e-6, case.photo_interval)
    part = part_of(progress, 0.0, RECORDING_SHARE)
    _experiment(case, room, 0, case.schedule, times, folder / RECORDING, clean=clean, progress=part)
    schedule, end = calibration_schedule(case)
    moments = np.linspace(0.0, end, CALIBRATION_PHOTOGRAPHS + 1)
    part = part_of(progress, RECORDING_SHARE, INJECTION_SHARE)
    _experiment(case, room, 1, schedule, moments, folder / INJECTION, progress=part)
    try:
        calibration = fit_of_injection(folder / INJECTION).calibration
    except CalibrationRefused as refusal:
        (folder / REFUSED).write_text(f'{refusal}\n', encoding='utf-8')
        raise
    save_calibration(calibration, folder / CALIBRATION)
    write_maps(folder / RECORDING, grid, calibration, sha256_of_file(folder / CALIBRATION))


MAPS = 'concentration.nc'

RECORDING_SHARE, INJECTION_SHARE = 0.7, 0.9
"""Share of the work that is done after both experiments; calibration and maps take the rest."""


def calibration_schedule(case: BlindCase) -> tuple[Schedule, float]:
    """Return the rates of a known injection on the rig of `case`, and its end [s].

    Tracer stock goes into the injecting wells of the case, one after the other.
    """
    tracer = {row.well: row.rate.rate for row in case.schedule.rows if row.rate.concentration == 1}
    radius = INJECTIONS_M * max(1.0, case.rig.width_m / SMALL_WIDTH_M)
    share = np.pi * radius**2 / (case.rig.width_m * case.rig.height_m)
    volume = float(share * case.rig.pore_volume)
    rows, time = [], 0.0
    for well, commanded in tracer.items():
        rate = max(commanded, from_ml_h(LEAST_RATE_ML_H))
        rows.append(ScheduleRow(time, well, WellRate(rate, 1.0)))
        time += volume / rate
        rows.append(ScheduleRow(time, well, WellRate()))
    return Schedule(tuple(rows)), time


SMALL_WIDTH_M = 0.934
LEAST_RATE_ML_H = 100.0
"""Least rate of a calibration [ml/h]; the last command of a well may be a rest."""


def _experiment(
    case: BlindCase,
    room: CameraRoom,
    number: int,
    schedule: Schedule,
    times: FloatArray,
    folder: Path,
    *,
    clean: Path | None = None,
    progress: Share = no_share,
) -> None:
    """Run experiment `number` on the rig of `case`, and write it with photographs at `times` [s].

    The baseline is taken at the first of `times`. A folder that exists is unfinished, and is made
    again.
    """
    if folder.exists():
        shutil.rmtree(folder)
    grid = case.rig.default_grid(case.cell_m)
    camera = room.camera(number, float(times[-1]))
    rig = case.virtual_rig(case.effects)
    finer = max(LEAST_FINER, rig.mesh.nx // grid.nx)
    photos = [_photo(0.0, 'baseline', camera.baseline())]
    seen = signals(
        rig,
        schedule,
        times=times.tolist(),
        grid=grid.refined(finer),
        passed=lambda time: progress(time / float(times[-1])),
    )
    maps = []
    for time, signal in seen:
        maps.append((time, conservative_resample(signal, grid.shape)))
        if time > 0.0:
            photos.append(_photo(time, 'state', camera.photograph(signal, time)))
    if clean is not None:
        with ConcentrationWriter(clean, grid) as writer:
            for time, values in maps:
                writer.append(time, values)
    write_folder(folder, RecordedData(room.told, commanded=schedule, photos=tuple(photos)))


def _photo(time: float, role: Role, data: bytes) -> Photo:
    return Photo(time, role, f'photos/{role}_{round(time):06d}.jpg', lambda: data)


def write_maps(folder: Path, grid: Grid, calibration: Calibration, made_by: str) -> None:
    """Image the photographs of the recording in `folder`, as `image` does.

    A photograph that is refused has no map. The file appears when it is complete.

    Args:
        folder: the recording; gets the maps.
        grid: grid of the maps.
        calibration: the calibration; the plumes of the recording refine its factors of sands.
        made_by: hash of the file of the calibration.

    Raises:
        InputError: the baseline cannot be used, or every photograph is refused.
    """
    data = folder_data(folder)
    found = [photo.read() for photo in data.photos if photo.role == 'baseline']
    states = [(photo.time, photo.read) for photo in data.photos if photo.role == 'state']
    used = refined(calibration, data.rig, found, states, data.commanded).calibration
    baseline = make_baseline(data.rig, grid, found, calibration=used)
    unfinished = folder / f'{MAPS}.unfinished'
    written = 0
    with ConcentrationWriter(unfinished, grid, origin=MapOrigin(True, made_by, PROGRAM)) as writer:
        for photo in data.photos:
            if photo.role != 'state':
                continue
            try:
                made = concentration_map(photo.read(), baseline)
            except InputError:
                continue
            writer.append(
                photo.time, made.values, deviation=made.deviation, systematic=made.systematic
            )
            written += 1
    if not written:
        raise InputError(f'{folder}: every photograph was refused; look at one of them')
    unfinished.rename(folder / MAPS)
