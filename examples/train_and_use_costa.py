"""Train COSTA on a scheme that is too diffusive, and use it on rates that it has not seen.

The model is the upwind scheme. The accurate scheme plays the real rig, so that the truth is known.
The network learns the residual r of the upwind scheme and returns the source term sigma. The
corrected prediction c solves

    L c = f_c + sigma.
"""

from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from picture import picture_path

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate, WellRates
from porotwin_core.rig import load_rig
from porotwin_costa.correction.corrective_source import corrective_source
from porotwin_costa.data.dataset_builder import build_dataset
from porotwin_costa.data.frames import Frames
from porotwin_costa.evaluation.evaluation import evaluate
from porotwin_costa.networks import architecture
from porotwin_costa.training.training import train
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate

SMALL_RIG = Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'

rig = load_rig(SMALL_RIG)
grid = rig.grid(47, 28)
interval = 60.0


def pumped(well: str, rate_ml_h: float, concentration: float = 1.0) -> WellRates:
    """Return one injection that the producer balances."""
    rate = from_ml_h(rate_ml_h)
    return {well: WellRate(rate, concentration), 'producer': WellRate(-rate)}


def experiment(name: str, first: WellRates, then: WellRates) -> Frames:
    """Return 40 minutes of the truth: the rates `first`, and `then` from the middle on."""
    schedule = Schedule.from_rates([(0.0, first), (1200.0, then)])
    times = np.arange(0.0, 2401.0, interval)
    return Frames(times, simulate(rig, schedule, times, grid=grid), schedule, name=name)


seen = [
    experiment('first', pumped('injector', 500.0), pumped('control1', 500.0, 0.0)),
    experiment('second', pumped('control2', 500.0), pumped('injector', 500.0, 0.0)),
    experiment('third', pumped('control1', 300.0), pumped('control3', 500.0, 0.0)),
]
unseen = experiment('unseen', pumped('injector', 400.0), pumped('control1', 350.0, 0.0))

model = Model(rig, grid, preset='upwind')
dataset = build_dataset(
    seen, rig, grid=grid, time_step=interval, predict=model.predict, residual=model.residual
)
network = architecture('local')
trained = train(dataset, network, network.training.with_epochs(10), seed=1)
result = evaluate(
    [unseen],
    time_step=interval,
    predict=model.predict,
    correct=model.correct,
    correction=partial(corrective_source, trained),
)
last = result.frames[-1]
print(f'one step: error {result.mean("predicted"):.4f}, {result.mean("corrected"):.4f} with COSTA')
print(f'after 40 min: {last.free_predicted:.3f}, {last.free_corrected:.3f} with COSTA')
assert result.mean('corrected') < 0.6 * result.mean('predicted')
assert last.free_corrected < 0.6 * last.free_predicted

figure, axes = plt.subplots(1, 2, figsize=(8, 2.8), layout='constrained')
minutes = [frame.time / 60 for frame in result.frames]
for axis, prefix, title in zip(axes, ('', 'free_'), ('one step', 'free-running'), strict=True):
    for kind, label in (('predicted', 'upwind'), ('corrected', 'upwind with COSTA')):
        errors = [getattr(frame, prefix + kind) for frame in result.frames]
        axis.plot(minutes, errors, '.-', label=label)
    axis.set(title=f'{title}, unseen rates', xlabel='time [min]', ylim=(0, None))
axes[0].set_ylabel('relative error [-]')
axes[0].legend()
figure.savefig(picture_path(__file__), dpi=90)
