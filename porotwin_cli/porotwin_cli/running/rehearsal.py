"""The preparation of the demo on the virtual rig: calibration of the camera, training of COSTA.

A known injection calibrates the camera. Experiments with other schedules train COSTA (paper,
section 3.1: tracer injected into different wells). Their photographs are taken and imaged as in the
experiment to come.
"""

from collections.abc import Callable
from concurrent.futures import as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from porotwin_cli.recorded.costa_data import (
    CorrectedModel,
    dataset_of,
    source_name,
    train_with_progress,
)
from porotwin_cli.terminal import progress
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import crew
from porotwin_core.basis.units import MINUTE_S, from_ml_h
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig
from porotwin_costa.data.frames import Frames
from porotwin_costa.networks import architecture
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.calibrating.calibration_fit import (
    CalibrationFit,
    InjectionSource,
    fit_calibration,
)
from porotwin_imaging.calibrating.calibration_pictures import write_fit
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.tracer.calibration import load_calibration
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model.plume_model import plume_model

ARCHITECTURE = 'local'
"""This network learns from few experiments; the paper's network needs many."""

CALIBRATED_SHARE, CALIBRATION_PHOTOS = 0.17, 8
"""Injected volume of the calibration over the pore volume [-], and its number of photographs. The
small rig takes 40 min."""

TRAINING_MINUTES = 12.0
"""Length of a training experiment [min]: water follows the tracer for half of it."""

TRAINING_EPOCHS = 20
"""Fewer than usual, so that the demo starts soon."""

INJECTION_ML_H = 500.0
"""Rate of all injections, as in the demo: COSTA is withheld where the wells pump more."""

TRAINING_WELLS = (
    ('injector', 'control1'),
    ('injector', 'control2'),
    ('control1', 'control3'),
    ('control2', 'injector'),
)
"""The wells that inject first tracer and then water in each training experiment."""


def injected_tracer(rig: Rig) -> tuple[str, float, float]:
    """Return the fixed well that injects the most tracer, its rate [ml/h] and concentration.

    Raises:
        InputError: the rig has none.
    """
    fixed = {} if rig.control is None else rig.control.fixed
    strength = {name: well.rate_ml_h * well.concentration for name, well in fixed.items()}
    if max(strength.values(), default=0.0) <= 0.0:
        raise InputError(
            'control.fixed names no well that injects tracer; give one a rate_ml_h and a '
            'concentration'
        )
    name = max(strength, key=lambda well: strength[well])
    return name, fixed[name].rate_ml_h, fixed[name].concentration


def producer_of(rig: Rig) -> str | None:
    """Return the well that takes out what others inject; None in a rig with an open side alone."""
    return None if rig.control is None else rig.control.producer


def balanced(rows: list[tuple[float, str, float, float]], producer: str | None) -> Schedule:
    """Return the schedule of `rows` with a producer, if there is one, that balances all injections.

    A row is (time [s], well, rate [ml/h], concentration [-]).
    """
    schedule: list[ScheduleRow] = []
    current: dict[str, float] = {}
    for time, well, rate_ml_h, concentration in rows:
        schedule.append(ScheduleRow(time, well, WellRate(from_ml_h(rate_ml_h), concentration)))
        current[well] = rate_ml_h
        if producer is not None:
            balance = WellRate(-from_ml_h(sum(current.values())))
            schedule.append(ScheduleRow(time, producer, balance))
    return Schedule(tuple(schedule))


def calibration_run(rig: Rig, folder: Path, *, seed: int, photo_width: int) -> Path:
    """Photograph a known injection with the virtual camera; return the calibration file.

    The recording goes to `folder`/calibration_run, pictures and file to `folder`/calibration.

    Raises:
        InputError: the folder is not empty, or the photographs do not suffice for a calibration.
    """
    with progress() as bar:
        task = bar.add_task('running the virtual rig', total=1.0)
        fit = calibration_fit(
            rig,
            folder,
            seed=seed,
            photo_width=photo_width,
            done=lambda share: bar.update(task, completed=share),
        )
    write_fit(fit, folder / 'calibration')
    return folder / 'calibration' / 'calibration.yaml'


def calibration_fit(
    rig: Rig,
    folder: Path,
    *,
    seed: int,
    photo_width: int,
    done: Callable[[float], None],
) -> CalibrationFit:
    """Photograph a known injection with the virtual camera; return the fitted calibration.

    The well of `injected_tracer` injects alone, without a pause. The recording goes to
    `folder`/calibration_run.
    `done` is told the share that the virtual rig has run.

    Raises:
        InputError: the folder is not empty, no fixed well injects tracer, or the photographs do not
            suffice for a calibration.
    """
    well, rate_ml_h, concentration = injected_tracer(rig)
    assert rig.control is not None
    without_pauses = rig.control.with_pauses({}, rig.control.end_min)
    rig = rig.model_copy(update={'control': without_pauses})
    duration = CALIBRATED_SHARE * rig.pore_volume / from_ml_h(rate_ml_h)
    duration = max(1, round(duration / MINUTE_S)) * MINUTE_S
    make_experiment(
        folder / 'calibration_run',
        VirtualRig(rig),
        commanded=balanced([(0.0, well, rate_ml_h, concentration)], producer_of(rig)),
        duration=duration,
        photo_interval=duration / CALIBRATION_PHOTOS,
        seed=seed,
        photo_width_px=photo_width,
        progress=done,
    )
    recording = open_recording(folder / 'calibration_run')
    baselines = [photo.read() for photo in recording.photos if photo.role == 'baseline']
    states = [(photo.time, photo.read()) for photo in recording.photos if photo.role == 'state']
    return fit_calibration(
        recording.rig,
        baselines,
        states,
        schedule=recording.schedule,
        plumes=partial(plume_model, recording.rig, recording.schedule),
        source=InjectionSource('calibration_run'),
    )


def training_schedules() -> list[Schedule]:
    """Return the schedules of the training experiments on the small rig."""
    half = TRAINING_MINUTES * 30.0
    return [
        balanced(
            [(0.0, tracer, INJECTION_ML_H, 1.0), (half, water, INJECTION_ML_H, 0.0)], 'producer'
        )
        for tracer, water in TRAINING_WELLS
    ]


@dataclass(frozen=True)
class TrainingRun:
    """A training experiment: its schedule, camera and the calibration of its photographs.

    `photo_interval` is the time between photographs [s], `photo_width` their width [px].
    """

    rig: Rig
    schedule: Schedule
    calibration: Path
    photo_interval: float
    photo_width: int
    seed: int

    def frames(self, folder: Path) -> Frames:
        """Photograph the experiment into `folder`; return its maps, made by the twin's imaging.

        Raises:
            InputError: a photograph or the calibration is unusable.
        """
        make_experiment(
            folder,
            VirtualRig(self.rig),
            commanded=self.schedule,
            duration=TRAINING_MINUTES * 60.0,
            photo_interval=self.photo_interval,
            seed=self.seed,
            photo_width_px=self.photo_width,
        )
        return imaged(open_recording(folder), self.rig.default_grid(), self.calibration)


def training_frames(runs: list[TrainingRun], folder: Path) -> list[Frames]:
    """Return the maps of all training experiments; one core works on each of them."""
    with crew() as pool, progress() as bar:
        made = [
            pool.submit(run.frames, folder / f'training_run_{number}')
            for number, run in enumerate(runs, 1)
        ]
        task = bar.add_task('training experiments', total=len(made))
        for _ in as_completed(made):
            bar.advance(task)
    return [frames.result() for frames in made]


def imaged(recording: Recording, grid: Grid, calibration: Path) -> Frames:
    """Return the frames of a recording, from its photographs with the twin's own imaging.

    Raises:
        InputError: a photograph or the calibration is unusable.
    """
    baseline = make_baseline(
        recording.rig,
        grid,
        [photo.read() for photo in recording.photos if photo.role == 'baseline'],
        calibration=load_calibration(calibration),
    )
    states = [photo for photo in recording.photos if photo.role == 'state']
    return Frames(
        times=np.array([photo.time for photo in states]),
        concentration=np.array(
            [concentration_map(photo.read(), baseline).values for photo in states]
        ),
        schedule=recording.schedule,
        name=source_name(recording),
    )


def train_costa(
    rig: Rig,
    folder: Path,
    calibration: Path,
    *,
    photo_interval: float,
    seed: int,
    preset: str,
    photo_width: int,
) -> Path:
    """Train COSTA on photographs of the training experiments; return the file of the model.

    `photo_interval` is the time between photographs [s], `photo_width` their width [px]; `preset`
    is the numerical scheme to correct; `seed` is that of the experiments and of the training.

    Raises:
        InputError: the calibration is unusable, or there are too few training pairs.
    """
    grid = rig.default_grid()
    runs = [
        TrainingRun(rig, schedule, calibration, photo_interval, photo_width, seed)
        for schedule in training_schedules()
    ]
    frames = training_frames(runs, folder)
    dataset = dataset_of(frames, CorrectedModel(rig, grid, preset, photo_interval))
    model = train_with_progress(
        dataset, architecture(ARCHITECTURE), epochs=TRAINING_EPOCHS, seed=seed
    )
    model.save(folder / 'costa')
    return folder / 'costa'
