"""What most people do, with `import porotwin` alone: open, simulate, image, train, control.

The sample bag holds six minutes of tracer. Each part is a function, as in a notebook's cell. The
type checker `mypy --strict` finds no fault in this script.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from picture import draw_map, picture_path

import porotwin

BAGS = Path(__file__).parents[1] / 'bags'


def simulated(recording: porotwin.Recording) -> porotwin.FloatArray:
    """Return the maps of the model at the times of the recording, (nt, nz, nx)."""
    return porotwin.simulate(
        recording.rig, recording.delivered, recording.times, grid=recording.grid, preset='fast'
    )


def imaged(recording: porotwin.Recording) -> porotwin.FloatArray:
    """Return the map of the last photograph, (nz, nx)."""
    first = [photo.read() for photo in recording.photos if photo.role == 'baseline']
    calibration = porotwin.load_calibration(BAGS / 'sample_calibration.yaml')
    baseline = porotwin.make_baseline(recording.rig, recording.grid, first, calibration=calibration)
    return porotwin.image(recording.photos[-1].read(), baseline).values


def diagnosed(recording: porotwin.Recording) -> str:
    """Return the cause of the gap, if it is the porosity or a rate; this takes a minute."""
    others = [name for name in porotwin.EFFECTS if name not in ('porosity', 'rate')]
    settings = porotwin.DiagnosisSettings(preset='fast', excluded=others)
    return porotwin.diagnose([recording], settings).verdict.name


def trained(recording: porotwin.Recording) -> porotwin.CorrectiveModel:
    """Return a network that saw this recording; it needs hours of them to be of use."""
    grid = recording.rig.grid(62, 37)
    model = porotwin.Model(recording.rig, grid, preset='fast')
    rates, times = recording.delivered, recording.times
    maps = porotwin.simulate(recording.rig, rates, times, grid=grid, preset='upwind')
    frames = porotwin.Frames(times, maps, rates)
    pairs = porotwin.build_dataset(
        [frames],
        recording.rig,
        grid=grid,
        time_step=30.0,
        predict=model.predict,
        residual=model.residual,
    )
    network = porotwin.architecture('local')
    return porotwin.train(pairs, network, network.training.with_epochs(2), seed=1)


def controlled(recording: porotwin.Recording) -> float:
    """Return the total of the rates [m^3/s] that the twin orders after the last map."""
    rig, grid = recording.rig, recording.grid
    controller = porotwin.Controller(
        porotwin.Limits.of(rig), porotwin.make_objective(rig, grid), horizon=120.0, evaluations=25
    )
    model = porotwin.Model(rig, grid, preset='fast')
    twin = porotwin.Twin(model, porotwin.no_correction, photo_interval=30.0, controller=controller)
    state = porotwin.Observation(float(recording.times[-1]), recording.concentration[-1])
    setpoint = twin.cycle(state).setpoint
    assert setpoint is not None
    return sum(rate.rate for rate in setpoint.rates.values())


recording = porotwin.open_recording(BAGS / 'sample')
observed, model = recording.concentration[-1], simulated(recording)[-1]
gap = float(np.abs(model - observed).mean())
print(f'porotwin {porotwin.__version__}: the model is {gap:.4f} from the maps')
assert gap < 0.01
assert float(np.abs(imaged(recording) - observed).mean()) < 0.01
assert trained(recording).grid.shape == (37, 62)
assert abs(controlled(recording)) < 1e-12

figure, axes = plt.subplots(1, 2, figsize=(8, 2.6), layout='constrained')
draw_map(axes[0], recording.rig, observed, title='photograph')
draw_map(axes[1], recording.rig, model, title='model')
figure.savefig(picture_path(__file__), dpi=80)
