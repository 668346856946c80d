"""How much COSTA learns of physics that the model lacks, as `./porotwin train` makes it.

Every case withholds one effect from the model. COSTA learns from four recordings, or from the first
70 % of one. Then the model runs freely over an unseen recording with other rates, or over the rest,
with COSTA and without. A run leaves one file, so that an interrupted bench goes on.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lab.blind.blind_cases import SMALL, small_schedule
from lab.study import FiguresJob, Study, study_folder
from porotwin_cli.recorded.costa_data import CorrectedModel, recording_of, train_on_runs
from porotwin_cli.running.drawn_effects import drawn
from porotwin_cli.terminal import print_table
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample, fill_unseen
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.free_run_gate import SETTLED, Judge, KeptRun, corrector
from porotwin_costa.data.frames import Frames, cut, resampled
from porotwin_costa.networks import architecture
from porotwin_costa.training.rollout_training import CURRICULUM
from porotwin_costa.training.run_training import TrainingChoice
from porotwin_rig.made_experiment import NoiseFloor, signals
from porotwin_rig.map_camera import MapCamera, MapNoise
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.adjoint.learnt_coefficients import LearntModels

RECORDED = (94, 56)
"""Columns and rows of the recordings: cells of 10 mm, with the noise of a camera."""

GRID = (62, 37)
"""Columns and rows of the maps for COSTA: cells of 15 mm; `train` takes 5 mm for this rig.
A training takes about a tenth of the time."""

INTERVAL_S = 60.0
"""Time between two maps [s], as in the blind check."""

NOISE = MapNoise(grain=0.0125, frame=0.004, blur_cells=0.3)
"""Noise of an ordinary camera, averaged over two by two cells."""

CASES = {
    'over-diffusive': 'upwind',
    'none': 'fast',
    'dispersion': 'fast',
    'buoyancy': 'fast',
    'heterogeneity': 'fast',
    'background_flow': 'fast',
    'retardation': 'fast',
    'leak': 'fast',
}
"""The effect of each case and the preset of the model; the first two have no effect."""

UNSEEN = 0
"""Number of the recording with the rates that COSTA never saw."""

LEARNT_FROM = (1, 2, 3, 4)
"""Numbers of the four recordings to learn from."""

FIRST_SHARE = 0.7
"""Share of a single recording to learn from [-]."""

SEED = 7
"""Seed of all trainings."""

RUN_BYTES = 2e9
"""Memory of one run [B]."""

SECONDS_PER_RUN = 180.0
"""One run on one core [s]: the mean over all."""


@dataclass(frozen=True)
class PhysicsFigures:
    """The figures of one training; errors are relative L2 norms against the noisy maps [-].

    Attributes:
        alone: mean error of the free run of the model alone, over the judged frames.
        corrected: the same with COSTA.
        late_alone: mean over the last 30 % of the run.
        late_corrected: the same with COSTA.
        worst_ratio: largest ratio of the two at any judged frame, after 0.01 is added to both.
        floor: error of the maps themselves, by noise and blur.
        learnt: the learnt physics; None without.
        gate: the decision of the gate.
        training_s: processor time of the training [s].
        inference_ms: median time of one correction, with the run of the learnt physics [ms].
    """

    alone: float
    corrected: float
    late_alone: float
    late_corrected: float
    worst_ratio: float
    floor: float
    learnt: dict[str, Any] | None
    gate: str
    training_s: float
    inference_ms: float


@dataclass(frozen=True)
class PhysicsJob(FiguresJob[PhysicsFigures]):
    """One training on one case; `draw` numbers the effects of a kind, `part` means 70 % of one."""

    case: str
    part: bool
    network: str
    seed: int
    draw: int
    file: Path
    kind: ClassVar = PhysicsFigures

    def figures(self) -> PhysicsFigures:
        """Train, run freely and return the figures."""
        unseen, floor = self._frames(UNSEEN)
        length = float(unseen.times[-1])
        if self.part:
            seen, judged_from = [cut(unseen, FIRST_SHARE * length)], FIRST_SHARE * length
        else:
            seen, judged_from = [self._frames(n)[0] for n in LEARNT_FROM], SETTLED * length
        grid, preset = SMALL.grid(*GRID), CASES[self.case]
        begun = time.process_time()
        model = train_on_runs(
            [recording_of(frames, SMALL) for frames in seen],
            CorrectedModel(SMALL, grid, preset, INTERVAL_S),
            TrainingChoice(
                architecture(self.network),
                SEED,
                curriculum=() if self.network == 'paper' else CURRICULUM,
            ),
            workers=1,  # other trainings run beside this one
        )
        trained = time.process_time() - begun
        model.save(self.file.with_suffix('.safetensors'))
        judge = Judge(LearntModels(SMALL, grid, preset), [KeptRun(unseen, judged_from)], INTERVAL_S)
        errors = judge.errors(model)
        late = unseen.times[unseen.times > judged_from] > FIRST_SHARE * length
        return PhysicsFigures(
            errors.mean_alone,
            errors.mean_corrected,
            float(np.mean(errors.alone[late])),
            float(np.mean(errors.corrected[late])),
            errors.worst_ratio,
            floor,
            None if model.learnt is None else model.learnt.description(),
            model.provenance['gate']['says'],
            trained,
            inference_ms(model, unseen, grid, preset),
        )

    def _frames(self, number: int) -> tuple[Frames, float]:
        """Return the maps of recording `number` with noise, and their error [-]."""
        times, maps, schedule = self._recording(number)
        camera = MapCamera(SMALL.grid(*RECORDED), NOISE, seed=1000 + number)
        seen = np.array([camera.map(one.astype(float), n) for n, one in enumerate(maps)])
        floor, coarse = NoiseFloor(), SMALL.grid(*GRID).shape
        for one, signal in zip(seen, maps, strict=True):
            floor.add(conservative_resample(one, coarse), conservative_resample(signal, coarse))
        frames = Frames(times, seen, schedule, deviation(seen), name=f'recording {number}')
        return resampled(frames, SMALL.grid(*GRID)), floor.value

    def _recording(self, number: int) -> tuple[FloatArray, FloatArray, Schedule]:
        """Return times [s], maps and schedule; the maps are kept in the folder."""
        schedule, duration, _ = small_schedule(self._generator(number), SMALL)
        times = np.arange(0.0, duration + 1.0, INTERVAL_S)
        file = self.file.parent / f'{self._truth}_{self.seed}_{self.draw}_recording_{number}.npy'
        if not file.exists():
            rig = VirtualRig(SMALL, effects=self.effects())
            run = signals(rig, schedule, times=times, grid=SMALL.grid(*RECORDED))
            part = file.with_suffix('.part.npy')
            np.save(part, np.array([signal for _, signal in run], dtype=np.float32))
            part.replace(file)
        return times, np.load(file), schedule

    def effects(self) -> tuple[EffectDescription, ...]:
        """Return the effect that the model lacks, if any."""
        if self._truth == 'none':
            return ()
        schedule, duration, wells = small_schedule(self._generator(UNSEEN), SMALL)
        injected = max(row.rate.rate for row in schedule.rows) / from_ml_h(1.0)
        context = DrawContext(SMALL, wells, duration, injected)
        return (drawn(self._truth, self._generator(sum(map(ord, self._truth))), context),)

    @property
    def _truth(self) -> str:
        return 'none' if self.case == 'over-diffusive' else self.case

    def _generator(self, number: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, self.draw, number])


def deviation(maps: FloatArray) -> FloatArray:
    """Return the standard deviation [-] of noisy `maps` (n, nz, nx), as an image analysis tells."""
    grain = NOISE.grain * maps
    frame = NOISE.frame * (NOISE.background + (1.0 - NOISE.background) * maps)
    found: FloatArray = np.hypot(grain, frame)
    return found


def inference_ms(
    model: CorrectiveModel, frames: Frames, grid: Grid, preset: str, rounds: int = 15
) -> float:
    """Return the median time of one correction [ms]; a first one does not count."""
    solver = LearntModels(SMALL, grid, preset)
    correct, plain = corrector(model, solver), solver.model(LearntPhysics())
    middle = len(frames.times) // 2
    start, end = float(frames.times[middle]), float(frames.times[middle + 1])
    state = fill_unseen(frames.concentration[middle], None)
    rates = frames.schedule.mean(start, end)
    predicted = plain.predict(state, rates, end - start)
    taken = []
    for _ in range(rounds + 1):
        begun = time.perf_counter()
        correct(plain, state, predicted, rates, end - start)
        taken.append(time.perf_counter() - begun)
    return 1e3 * float(np.median(taken[1:]))


def jobs_of(folder: Path, *, draws: int, seed: int) -> list[PhysicsJob]:
    """Return all trainings, the most wanted ones first."""
    return [
        PhysicsJob(
            *(case, part, network, seed, draw),
            folder / f'{case}_{seed}_{draw}_{"part" if part else "four"}_{network}.json',
        )
        for part, network in ((False, 'hybrid'), (True, 'hybrid'), (False, 'paper'))
        for draw in range(draws)
        for case in CASES
    ]


def run(
    *,
    scenarios: int = 1,
    seed: int = 1,
    workers: int | None = None,
    scheduler: str = '',
    output: Path | None = None,
) -> list[dict[str, Any]]:
    """Train on all cases and return a row for each training.

    Args:
        scenarios: draws of every effect.
        seed: of the draws.
        workers: trainings at a time; None: one per core, as far as the memory holds.
        scheduler: address of a Dask scheduler whose workers do the trainings instead.
        output: folder of the trainings; one with earlier ones is continued.

    Raises:
        InputError: the folder cannot be used.
    """
    folder = study_folder(output, 'bench-physics', lambda path: any(path.glob('*_recording_*.npy')))
    jobs = jobs_of(folder, draws=scenarios, seed=seed)
    Study(folder, RUN_BYTES, workers, scheduler).do(jobs, seconds_per_job=SECONDS_PER_RUN)
    return [row(job) for job in jobs]


def row(job: PhysicsJob) -> dict[str, Any]:
    """Return the figures of a training that is done."""
    found = job.found()
    return {
        'lacking': job.case,
        'learnt from': '70 % of one' if job.part else 'four',
        'network': job.network,
        'alone': found.alone,
        'with COSTA': found.corrected,
        'ratio': found.corrected / found.alone,
        'last 30 %, alone': found.late_alone,
        'last 30 %, with COSTA': found.late_corrected,
        'worst frame': found.worst_ratio,
        'maps': found.floor,
        'training [s]': found.training_s,
        'inference [ms]': found.inference_ms,
    }


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Print a table of all trainings."""
    table = [
        [f'{value:.3g}' if isinstance(value, float) else value for value in one.values()]
        for one in rows
    ]
    print_table('free runs at unseen rates', list(rows[0]), table)
