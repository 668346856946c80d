"""Write a new effect: a layer of finer sand lies on the bottom, and the tracer flows above it.

    permeability(z) = nominal permeability * factor   for z < height

The effect is defined here, and `EFFECTS` learns it under its name. An effect of the project is a
file of its own (docs/extend/effect.md); then `./porotwin diagnose` looks for it as well.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from picture import draw_map, picture_path

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import relative_error
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import load_rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects import EFFECTS, parse_effect
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Effect, Scope
from porotwin_solver.effects.definition.words import factor
from porotwin_solver.model.simulation import simulate

SMALL_RIG = Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'


def settle(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another permeability below the height of the layer."""
    in_layer = physics.grid.z[:, None] < values['height']
    scale = np.where(in_layer, values['factor'], 1.0)
    return replace(physics, permeability=physics.permeability * scale)


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the factor of a layer over the lower third of the rig."""
    third = context.rig.height_m / 3
    scale = FitParameter('factor', '-', neutral=1.0, step=0.1, low=0.01, high=100.0, log=True)
    return [Candidate('layer', (scale,), fixed={'height': third})]


def phrase(values: Values) -> str:
    """Say how permeable the layer is."""
    permeable = factor(values['factor'], 'more permeable', 'less permeable', 'as permeable')
    return f'the lowest sand is {permeable}'


EFFECTS['layer'] = Effect(
    name='layer',
    scope=Scope.RIG,
    parameters={
        'factor': Parameter(unit='-', above=0.0, neutral=1.0),
        'height': Parameter(unit='m', above=0.0),
    },
    on_physics=settle,
    candidates=candidates,
    phrase=phrase,
    laboratory_check='sieve a sample of the lowest sand',
)

rig = load_rig(SMALL_RIG)
grid = rig.grid(94, 56)
rates = {'injector': WellRate(from_ml_h(500.0), 1.0), 'producer': WellRate(from_ml_h(-500.0))}
schedule, times = Schedule.constant(rates), [3600.0]
layer = parse_effect('layer:factor=0.1,height=0.2')
without = simulate(rig, schedule, times, grid=grid)[0]
with_layer = simulate(rig, schedule, times, grid=grid, effects=[layer])[0]

difference = relative_error(with_layer, without)
print(f'{EFFECTS["layer"].phrase(layer.parameters)}: the maps differ by {100 * difference:.0f} %')
assert 0.2 < difference < 1.0
assert np.isclose(with_layer.sum(), without.sum(), rtol=0.01)  # no tracer is lost

figure, axes = plt.subplots(1, 3, figsize=(11, 2.4), layout='constrained', sharey=True)
for axis, values, title in zip(axes, (without, with_layer), ('nominal', 'layer'), strict=False):
    image = draw_map(axis, rig, values, title=f'{title}, {times[0] / 60:.0f} min')
figure.colorbar(image, ax=axes[:2], shrink=0.9, label='concentration [-]')
change = with_layer - without
shown = draw_map(axes[2], rig, change, title='layer - nominal', cmap='RdBu_r', vmin=-1)
figure.colorbar(shown, ax=axes[2], shrink=0.9, label='difference [-]')
for axis in axes[1:]:
    axis.label_outer()
    axis.axhline(float(layer.parameters['height']), color='0.5', linestyle='--')
figure.savefig(picture_path(__file__), dpi=90)
