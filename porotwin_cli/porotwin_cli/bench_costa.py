"""What COSTA earns and costs: the physics-based model with it and without, on a run kept aside."""

import time
from typing import Any

import numpy as np

from porotwin_cli.costa_data import dataset_of
from porotwin_cli.rehearsal import (
    ARCHITECTURE,
    TRAINING_EPOCHS,
    TRAINING_MINUTES,
    balanced,
    training_schedules,
)
from porotwin_cli.workspace import small_rig
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig, load_rig
from porotwin_core.wells import Schedule
from porotwin_costa.architectures import training_settings
from porotwin_costa.dataset import Frames
from porotwin_costa.evaluation import evaluate
from porotwin_costa.training import train
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model import Model

INTERVAL_S = 30.0
GRID = (94, 56)
PRESETS = ('upwind', 'fast')
SEED = 7


def run(
    *,
    minutes: float = TRAINING_MINUTES,
    epochs: int = TRAINING_EPOCHS,
    settings: tuple[str, ...] = PRESETS,
) -> list[dict[str, Any]]:
    """Return a row per scheme: relative errors with COSTA and without, their ratio, times [s].

    The truth is the virtual rig, which shares no numerics with the schemes; its maps are taken
    without a camera. COSTA learns from the demo's training schedules. The run kept aside pumps
    rates and a sequence that are not among them. The network's time is that of so many predictions.
    """
    rig = load_rig(small_rig())
    grid = rig.grid(*GRID)
    seen = [_frames(rig, told, grid, minutes, 'seen') for told in training_schedules()]
    half = 30.0 * minutes
    aside = balanced([(0.0, 'injector', 400.0, 1.0), (half, 'control1', 150.0, 0.0)], 'producer')
    unseen = _frames(rig, aside, grid, minutes, 'kept aside')
    return [_row(rig, grid, preset, seen, unseen, epochs) for preset in settings]


def _frames(rig: Rig, told: Schedule, grid: Grid, minutes: float, name: str) -> Frames:
    asset = VirtualRig(rig)
    times = np.arange(0.0, 60.0 * minutes + 1.0, INTERVAL_S)
    maps = [asset.concentration(grid)]
    for moment in times[:-1]:
        for low, high, rates in told.intervals(float(moment), float(moment) + INTERVAL_S):
            asset.set_rates(rates)
            asset.advance(high - low)
        maps.append(asset.concentration(grid))
    return Frames(times, np.array(maps), told, name=name)


def _row(
    rig: Rig, grid: Grid, preset: str, seen: list[Frames], unseen: Frames, epochs: int
) -> dict[str, Any]:
    physics = Model(rig, grid, preset=preset)
    dataset = dataset_of(seen, rig, grid=grid, time_step=INTERVAL_S, preset=preset)
    begun = time.perf_counter()
    learned = train(dataset, training_settings(ARCHITECTURE, epochs=epochs), seed=SEED)
    trained = time.perf_counter() - begun
    learned = learned.for_wells(tuple(rig.wells), grid)
    result = evaluate(
        [unseen],
        time_step=INTERVAL_S,
        predict=physics.predict,
        correct=physics.correct,
        assess=learned.assess,
    )
    rates, state = unseen.schedule.at(0.0), unseen.concentration[-1]
    plain = _seconds(lambda: physics.predict(state, rates, INTERVAL_S))
    network = _seconds(lambda: learned.assess(state, rates))
    one, free = result.mean('predicted'), result.frames[-1].free_predicted
    return {
        'scheme': preset,
        'one step': round(one, 4),
        'with COSTA': round(result.mean('corrected'), 4),
        'ratio': round(result.mean('corrected') / one, 2),
        'free run': round(free, 4),
        'free with COSTA': round(result.frames[-1].free_corrected, 4),
        'free ratio': round(result.frames[-1].free_corrected / free, 2),
        'time of a prediction': f'{network / plain:.1f}',
        'training [s]': round(trained, 1),
    }


def _seconds(work: Any, rounds: int = 9) -> float:
    """Return the median time of `rounds` calls, after one that does not count."""
    work()
    taken = []
    for _ in range(rounds):
        begun = time.perf_counter()
        work()
        taken.append(time.perf_counter() - begun)
    return float(np.median(taken))
