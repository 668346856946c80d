"""Errors with and without COSTA on an unseen experiment, and the time that COSTA takes."""

import time
from functools import partial
from typing import Any

import numpy as np

from porotwin_cli.recorded.costa_data import CorrectedModel, dataset_of
from porotwin_cli.running.rehearsal import (
    ARCHITECTURE,
    TRAINING_EPOCHS,
    TRAINING_MINUTES,
    balanced,
    training_schedules,
)
from porotwin_cli.workspace import small_rig
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig, load_rig
from porotwin_costa.correction.corrective_source import corrective_source
from porotwin_costa.data.frames import Frames
from porotwin_costa.evaluation.evaluation import evaluate
from porotwin_costa.networks import architecture
from porotwin_costa.training.training import train
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model.model import Model

INTERVAL_S = 30.0
"""Time between two frames [s], as in the demo."""

GRID = (94, 56)
"""Columns and rows: cells of 10 mm."""

PRESETS = ('upwind', 'fast')
SEED = 7

UNSEEN_TRACER_ML_H = 400.0
UNSEEN_WATER_ML_H = 150.0
"""Rates of the unseen experiment: within the trained ones, and in none of the schedules."""


def run(
    *,
    minutes: float = TRAINING_MINUTES,
    epochs: int = TRAINING_EPOCHS,
    presets: tuple[str, ...] = PRESETS,
) -> list[dict[str, Any]]:
    """Return a row per preset: relative errors with and without COSTA, their ratio, times.

    The truth is the virtual rig, which shares no numerics with the solver; there is no camera.
    COSTA learns from the training schedules of the demo. The unseen experiment has other rates in
    another order. The time of the network is given as a number of predictions of the solver.

    Args:
        minutes: length of each experiment [min].
        epochs: passes over the training data.
        presets: numerical schemes to measure.
    """
    rig = load_rig(small_rig())
    grid = rig.grid(*GRID)
    seen = [_frames(rig, schedule, grid, minutes, 'seen') for schedule in training_schedules()]
    half = 30.0 * minutes
    other = balanced(
        [(0.0, 'injector', UNSEEN_TRACER_ML_H, 1.0), (half, 'control1', UNSEEN_WATER_ML_H, 0.0)],
        'producer',
    )
    unseen = _frames(rig, other, grid, minutes, 'unseen')
    return [_row(rig, grid, preset, seen, unseen, epochs) for preset in presets]


def _frames(rig: Rig, schedule: Schedule, grid: Grid, minutes: float, name: str) -> Frames:
    asset = VirtualRig(rig)
    times = np.arange(0.0, 60.0 * minutes + 1.0, INTERVAL_S)
    maps = [asset.concentration(grid)]
    for moment in times[:-1]:
        for low, high, rates in schedule.intervals(float(moment), float(moment) + INTERVAL_S):
            asset.set_rates(rates)
            asset.advance(high - low)
        maps.append(asset.concentration(grid))
    return Frames(times, np.array(maps), schedule, name=name)


def _row(
    rig: Rig, grid: Grid, preset: str, seen: list[Frames], unseen: Frames, epochs: int
) -> dict[str, Any]:
    physics = Model(rig, grid, preset=preset)
    dataset = dataset_of(seen, CorrectedModel(rig, grid, preset, INTERVAL_S))
    begun = time.perf_counter()
    network = architecture(ARCHITECTURE)
    learned = train(dataset, network, network.training.with_epochs(epochs), seed=SEED)
    trained = time.perf_counter() - begun
    learned = learned.for_wells(tuple(rig.wells), grid)
    result = evaluate(
        [unseen],
        time_step=INTERVAL_S,
        predict=physics.predict,
        correct=physics.correct,
        correction=partial(corrective_source, learned),
    )
    rates, state = unseen.schedule.at(0.0), unseen.concentration[-1]
    plain = _seconds(lambda: physics.predict(state, rates, INTERVAL_S))
    corrected = _seconds(lambda: corrective_source(learned, state, rates, INTERVAL_S))
    one, free = result.mean('predicted'), result.frames[-1].free_predicted
    return {
        'scheme': preset,
        'one step': round(one, 4),
        'with COSTA': round(result.mean('corrected'), 4),
        'ratio': round(result.mean('corrected') / one, 2),
        'free run': round(free, 4),
        'free with COSTA': round(result.frames[-1].free_corrected, 4),
        'free ratio': round(result.frames[-1].free_corrected / free, 2),
        'time of a prediction': f'{corrected / plain:.1f}',
        'training [s]': round(trained, 1),
    }


def _seconds(work: Any, rounds: int = 9) -> float:
    """Return the median time of `rounds` calls [s]; a first call does not count."""
    work()
    times = []
    for _ in range(rounds):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return float(np.median(times))
