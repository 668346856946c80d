"""The paper's experiments on the accuracy of the twin (section 3), on the virtual rig.

The virtual rig takes the place of the laboratory, and its maps have the noise of a camera. Every
network is trained on the same maps and judged on the same unseen ones.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lab.blind.blind_cases import large_rig
from porotwin_cli.recorded.costa_data import CorrectedModel, recording_of, train_on_runs
from porotwin_cli.running.rehearsal import balanced, training_schedules
from porotwin_cli.terminal import progress, say
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.units import HOUR_S, from_ml_h
from porotwin_core.geometry.grid import Grid, conservative_resample
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import EffectDescription, Rig, load_rig
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.corrective_source import LearntStep, corrective_source
from porotwin_costa.data.frames import Frames, cut
from porotwin_costa.evaluation.evaluation import Evaluation, evaluate
from porotwin_costa.evaluation.evaluation_pictures import write_pictures
from porotwin_costa.networks import architecture
from porotwin_costa.training.rollout_training import CURRICULUM
from porotwin_costa.training.run_training import TrainingChoice
from porotwin_rig.made_experiment import signals
from porotwin_rig.map_camera import MapCamera, MapNoise
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.adjoint.learnt_coefficients import LearntModels

SEED = 7

PULSES_H = (0.0, 1.1, 2.6, 4.0, 5.2, 8.0, 10.0, 24.5)
"""Starts of the pulses of 30 min in the large rig [h]: close ones first, then a long pause."""

PULSE_ML_H = 2250.0
"""Rate of a pulse in the large rig [ml/h] (FluidFlower benchmark)."""

DENSER_KG_M3 = 0.02
"""Density that the model of the large rig does not know about [kg/m^3]: the longest pause moves
the tracer by a few centimetres."""

LARGE_CELL_M = 0.02
"""Size of the elements of the virtual large rig [m]: half the width of its thinnest layer bend."""

CELL_MM, LARGE_GRID_CELL_MM = 10.0, 25.0
"""Usual cells of the maps of the small and the large rig [mm]."""

FREE_RUN_FROM_S = 66 * 60.0
"""Start of the free run in the large rig [s], the paper's 1 h 6 min."""


@dataclass(frozen=True)
class PaperExperiment:
    """The maps to learn from and the unseen maps to predict.

    `shown_times` [s]: the times of the pictures of maps.
    """

    rig: Rig
    grid: Grid
    preset: str
    time_step: float
    seen: Sequence[Frames]
    unseen: Frames
    networks: tuple[str, ...]
    shown_times: tuple[float, ...]

    def evaluated(self, model: CorrectiveModel) -> Evaluation:
        """Return the errors on the unseen maps with `model`."""
        solver = LearntModels(self.rig, self.grid, self.preset)
        plain = solver.model(LearntPhysics())
        physics = None if model.learnt is None else LearntStep(model.learnt, solver)
        return evaluate(
            [self.unseen],
            time_step=self.time_step,
            predict=plain.predict,
            correct=plain.correct,
            correction=partial(corrective_source, model, physics=physics),
            shown_times=self.shown_times,
        )


def diffusive(minutes: float = 40.0, cell_mm: float = CELL_MM) -> PaperExperiment:
    """Return section 3.1: homogeneous sand and a model that is too diffusive on purpose.

    Each training experiment takes `minutes` [min], half of it tracer. The paper's pictures are of
    10 and 30 min. `cell_mm` is the size of the cells of the maps [mm].
    """
    rig = load_rig(small_rig())
    grid, step = rig.default_grid(1e-3 * cell_mm), 30.0
    half = 0.5 * minutes * 60.0
    schedules = [
        Schedule(tuple(replace(row, time=half if row.time else 0.0) for row in schedule.rows))
        for schedule in training_schedules()
    ]
    other = balanced(
        [(0.0, 'injector', 400.0, 1.0), (1.5 * half, 'control1', 150.0, 0.0)], 'producer'
    )
    observe = partial(observed, rig, grid, duration=2.0 * half, interval=step)
    seen = [observe(schedule, number=n) for n, schedule in enumerate(schedules)]
    unseen = observe(other, number=len(seen))
    shown = (600.0, 1800.0)
    return PaperExperiment(
        rig, grid, 'upwind', step, seen, unseen, ('paper', 'local', 'hybrid'), shown
    )


def complex_(hours: float = 27.5, cell_mm: float = LARGE_GRID_CELL_MM) -> PaperExperiment:
    """Return section 3.2: layers of five sands, pulses and pauses, a tracer that is too dense.

    COSTA learns from the first 70 % of the `hours` [h] and predicts all of them. `cell_mm` is the
    size of the cells of the maps [mm].
    """
    rig = large_rig()
    grid, step = rig.default_grid(1e-3 * cell_mm), 300.0
    rows = []
    for number, start in enumerate(at for at in PULSES_H if at < hours):
        well = ('injector', 'injector2')[number % 2]
        rate = WellRate(from_ml_h(PULSE_ML_H), 1.0)
        rows.append(ScheduleRow(start * HOUR_S, well, rate))
        rows.append(ScheduleRow((start + 0.5) * HOUR_S, well, WellRate()))
    denser = EffectDescription(name='buoyancy', parameters={'density_difference': DENSER_KG_M3})
    whole = observed(
        rig,
        grid,
        Schedule(tuple(rows)),
        duration=hours * HOUR_S,
        interval=step,
        number=0,
        effects=[denser],
        cell=LARGE_CELL_M,
    )
    seen = cut(whole, 0.7 * hours * HOUR_S)
    unseen = replace(
        whole,
        times=whole.times[whole.times >= FREE_RUN_FROM_S],
        concentration=whole.concentration[whole.times >= FREE_RUN_FROM_S],
        name='large',
    )
    shown = (3.0 * HOUR_S + 3000.0, 4.0 * HOUR_S + 2400.0)
    return PaperExperiment(
        rig, grid, 'fast', step, [seen], unseen, ('paper-complex', 'hybrid'), shown
    )


def observed(
    rig: Rig,
    grid: Grid,
    schedule: Schedule,
    *,
    duration: float,
    interval: float,
    number: int,
    effects: Sequence[EffectDescription] = (),
    cell: float | None = None,
) -> Frames:
    """Return the maps of an experiment on the virtual rig, every `interval` [s] for `duration` [s].

    `cell` is the size of the elements of the virtual rig [m]; `number` names the experiment.
    """
    asset = VirtualRig(rig, effects=effects, cell=cell)
    fine = rig.default_grid() if cell is None else grid
    camera = MapCamera(fine, MapNoise(), seed=SEED + number)
    times = np.arange(0.0, duration + 1.0, interval)
    maps = []
    with progress() as bar:
        task = bar.add_task(f'experiment {number + 1}', total=len(times))
        for n, (_, signal) in enumerate(signals(asset, schedule, times=times, grid=fine)):
            maps.append(conservative_resample(camera.map(signal, n), grid.shape))
            bar.advance(task)
    return Frames(times, np.array(maps), schedule, name=f'experiment {number + 1}')


def run(make: Callable[[], PaperExperiment], folder: Path, *, seed: int) -> list[dict[str, Any]]:
    """Make the experiment, train its networks, write pictures; return a row for every network."""
    experiment = make()
    rows = []
    for name in experiment.networks:
        say(f'training the network {name}')
        model = train_on_runs(
            [recording_of(frames, experiment.rig) for frames in experiment.seen],
            CorrectedModel(
                experiment.rig, experiment.grid, experiment.preset, experiment.time_step
            ),
            TrainingChoice(
                architecture(name),
                seed,
                curriculum=() if name.startswith('paper') else CURRICULUM,
            ),
        )
        model.save(folder / name / 'model')
        result = experiment.evaluated(model)
        result.write_csv(folder / name / 'errors.csv')
        write_pictures(result, experiment.grid, folder / name)
        rows.append(_row(name, result))
    return rows


def _row(name: str, result: Evaluation) -> dict[str, Any]:
    (errors,) = result.by_recording().values()
    row: dict[str, Any] = {'network': name}
    for key, label in (
        ('one_step', 'one step'),
        ('free_running_last_30_percent', 'free run, last 30 %'),
        ('free_running_end', 'free run, end'),
    ):
        row[f'{label}, model'] = round(errors[key]['model'], 4)
        row[f'{label}, COSTA'] = round(errors[key]['costa'], 4)
    return row
