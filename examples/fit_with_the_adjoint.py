"""Fit the porosity of the sand and the dispersivity to observed maps, with adjoint gradients.

One backward run yields the derivative of the cost J by all parameters:

    J(p) = 1/2 sum over cells and times of (simulated - observed)^2.

The observed maps come from the same model with other parameters, so that the truth is known.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from picture import picture_path
from scipy.optimize import minimize

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import EffectDescription, load_rig
from porotwin_solver.adjoint import gradient
from porotwin_solver.model.simulation import simulate

SMALL_RIG = Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'

rig = load_rig(SMALL_RIG)
grid = rig.grid(62, 37)
rates = {
    'injector': WellRate(from_ml_h(500.0), 1.0),
    'producer': WellRate(from_ml_h(-500.0)),
}
schedule = Schedule.constant(rates)
times = np.linspace(300.0, 2400.0, 8)
names = [('porosity', 'factor'), ('dispersion', 'longitudinal_dispersivity')]
truth = np.array([1.08, 3e-3])


def effects(parameters: FloatArray) -> list[EffectDescription]:
    """Return the two effects with `parameters`: porosity factor [-], dispersivity [m]."""
    factor, longitudinal = (float(value) for value in parameters)
    spreading = {
        'longitudinal_dispersivity': longitudinal,
        'transverse_dispersivity': 3e-4,
        'diffusion': 1e-9,
    }
    return [
        EffectDescription(name='porosity', parameters={'factor': factor}),
        EffectDescription(name='dispersion', parameters=spreading),
    ]


observed = simulate(rig, schedule, times, grid=grid, preset='fast', effects=effects(truth))
scale = np.array([1.0, 1e-3])
history: list[float] = []


def cost_and_gradient(scaled: FloatArray) -> tuple[float, FloatArray]:
    """Return J and dJ/dp for parameters in units of `scale`."""

    def cost(index: int, shown: FloatArray) -> tuple[float, FloatArray]:
        difference = shown - observed[index]
        return 0.5 * float((difference**2).sum()), difference

    result = gradient(
        rig, schedule, times, cost, grid=grid, effects=effects(scaled * scale), parameters=names
    )
    history.append(result.cost)
    return result.cost, result.parameters * scale


bounds = [(0.5, 2.0), (0.35, 20.0)]
found = minimize(cost_and_gradient, [1.0, 1.0], jac=True, method='L-BFGS-B', bounds=bounds)
fitted = found.x * scale
print(f'porosity factor {fitted[0]:.4f} (truth {truth[0]}), ', end='')
print(f'dispersivity {1e3 * fitted[1]:.3f} mm (truth {1e3 * truth[1]}), {len(history)} gradients')
assert np.allclose(fitted, truth, rtol=1e-2)

figure, axis = plt.subplots(figsize=(5, 3), layout='constrained')
axis.semilogy(np.arange(1, len(history) + 1), history, 'o-')
axis.set(xlabel='gradient', ylabel='cost J', title='L-BFGS with adjoint gradients')
figure.savefig(picture_path(__file__), dpi=100)
