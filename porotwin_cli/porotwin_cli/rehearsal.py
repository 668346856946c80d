"""What a laboratory does before the experiment that counts, on the virtual rig.

A known injection calibrates the camera; experiments with other schedules, photographed and imaged
as the real one will be, train COSTA (paper, section 3.1: tracer injected in different wells).
"""

from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import numpy as np

from porotwin_cli.costa_data import dataset_of, source_name
from porotwin_cli.output import progress
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_costa.architectures import training_settings
from porotwin_costa.dataset import Frames
from porotwin_costa.training import TrainingProgress, train
from porotwin_imaging.calibrate import calibrate
from porotwin_imaging.calibration import load_calibration
from porotwin_imaging.chain import Imaging
from porotwin_recording.recording import Recording, open_recording
from porotwin_rig.made_experiment import make_experiment

ARCHITECTURE = 'local'
"""Learns from few experiments; the paper's own network needs many (see `./porotwin train`)."""

CALIBRATION_MINUTES = 40.0
CALIBRATION_PHOTOS = 8
TRAINING_MINUTES = 20.0
TRAINING_EPOCHS = 20
TRAINING_WELLS = (
    ('injector', 'control1'),
    ('injector', 'control2'),
    ('control1', 'control3'),
    ('control2', 'injector'),
)
"""Of each training experiment: the well that injects tracer, and the one that injects water."""


def balanced(rows: list[tuple[float, str, float, float]], producer: str) -> Schedule:
    """Return the schedule of (time [s], well, rate [ml/h], concentration), balanced."""
    told: list[ScheduleRow] = []
    current: dict[str, float] = {}
    for time, well, rate_ml_h, concentration in rows:
        told.append(ScheduleRow(time, well, WellRate(from_ml_h(rate_ml_h), concentration)))
        current[well] = rate_ml_h
        told.append(ScheduleRow(time, producer, WellRate(-from_ml_h(sum(current.values())))))
    return Schedule(tuple(told))


def calibration_run(rig: Rig, folder: Path, *, seed: int, photo_width: int) -> Path:
    """Photograph a known injection with the demo's camera and return its calibration file."""
    duration = CALIBRATION_MINUTES * 60.0
    make_experiment(
        folder / 'calibration_run',
        rig,
        commanded=balanced([(0.0, 'injector', 500.0, 1.0)], 'producer'),
        duration=duration,
        photo_interval=duration / CALIBRATION_PHOTOS,
        seed=seed,
        photo_width_px=photo_width,
    )
    recording = open_recording(folder / 'calibration_run')
    baselines = [photo.read() for photo in recording.photos if photo.role == 'baseline']
    states = [(photo.time, photo.read()) for photo in recording.photos if photo.role == 'state']
    calibrate(
        recording.rig,
        baselines,
        states,
        schedule=recording.schedule,
        output=folder / 'calibration',
        source='calibration_run',
    )
    return folder / 'calibration' / 'calibration.yaml'


def training_schedules() -> list[Schedule]:
    """Return what is pumped in the training experiments on the small rig, `TRAINING_MINUTES` long.

    The strongest pumping is among them: beyond what it has seen, COSTA holds back.
    """
    half = TRAINING_MINUTES * 30.0
    return [
        balanced([(0.0, tracer, 500.0, 1.0), (half, water, 500.0, 0.0)], 'producer')
        for tracer, water in TRAINING_WELLS
    ]


def training_runs(
    rig: Rig, folder: Path, *, photo_interval: float, seed: int, photo_width: int
) -> list[Path]:
    """Photograph experiments with other schedules than the one to come; return their folders."""
    schedules = enumerate(training_schedules(), 1)
    jobs = [(folder / f'training_run_{number}', told) for number, told in schedules]
    with ProcessPoolExecutor() as pool, progress() as bar:
        made = [
            pool.submit(
                make_experiment,
                path,
                rig,
                commanded=told,
                duration=TRAINING_MINUTES * 60.0,
                photo_interval=photo_interval,
                seed=seed,
                photo_width_px=photo_width,
            )
            for path, told in jobs
        ]
        for run in bar.track(as_completed(made), len(made), description='training experiments'):
            run.result()
    return [path for path, _ in jobs]


def imaged(recording: Recording, grid: Grid, calibration: Path) -> Frames:
    """Return the frames of a recording as the twin's own imaging reads its photographs."""
    imaging = Imaging(recording.rig, grid, calibration=load_calibration(calibration))
    imaging.set_baselines([p.read() for p in recording.photos if p.role == 'baseline'])
    states = [photo for photo in recording.photos if photo.role == 'state']
    with progress() as bar:
        maps = [
            imaging.concentration(photo.read()).values
            for photo in bar.track(states, description='their photographs to maps')
        ]
    return Frames(
        times=np.array([photo.time for photo in states]),
        concentration=np.array(maps),
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
    """Train COSTA on the training runs as the camera sees them; return the model's folder."""
    grid = rig.default_grid()
    runs = training_runs(
        rig, folder, photo_interval=photo_interval, seed=seed, photo_width=photo_width
    )
    frames = [imaged(open_recording(run), grid, calibration) for run in runs]
    dataset = dataset_of(frames, rig, grid=grid, time_step=photo_interval, preset=preset)
    settings = training_settings(ARCHITECTURE, epochs=TRAINING_EPOCHS)
    with progress() as bar:
        task = bar.add_task('training COSTA', total=settings.epochs)

        def on_epoch(state: TrainingProgress) -> None:
            bar.update(task, completed=state.epoch)

        model = train(dataset, settings, seed=seed, progress=on_epoch)
    model.save(folder / 'costa')
    return folder / 'costa'
