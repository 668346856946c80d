"""A thin straight line from (x, z) to (x_end, z_end) has another permeability."""

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from porotwin_core.model.blind_draw import (
    DrawContext,
    DrawnValues,
    log_uniform,
    place_near_injector,
)
from porotwin_core.model.effect_limits import MOST_PERMEABILITY_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change_line(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another permeability on the line."""
    x, z = rig.element_places
    start = np.array([values['x'], values['z']])
    span = np.array([values['x_end'], values['z_end']]) - start
    along = ((x - start[0]) * span[0] + (z - start[1]) * span[1]) / max(float(span @ span), 1e-12)
    along = np.clip(along, 0.0, 1.0)
    distance = np.hypot(x - start[0] - along * span[0], z - start[1] - along * span[1])
    on_line = distance <= 0.5 * values['width']
    factor = np.where(on_line, values['permeability_factor'], 1.0)
    return replace(rig, permeability=rig.permeability * factor)


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a tight line 18 cm long and 6 mm thick on the small rig, near the injector."""
    x, z = place_near_injector(generator, context)
    size = context.size
    return {
        'x': x - 0.04 * size,
        'z': z - 0.08 * size,
        'x_end': x + 0.04 * size,
        'z_end': z + 0.08 * size,
        'width': 0.006 * size,
        'permeability_factor': log_uniform(generator, 0.03, 0.15),
    }


EFFECT = AssetEffect(
    name='streak',
    order=200,
    parameters={
        'x': Parameter(unit='m'),
        'z': Parameter(unit='m'),
        'x_end': Parameter(unit='m'),
        'z_end': Parameter(unit='m'),
        'width': Parameter(unit='m', low=0.0, default=0.006),
        'permeability_factor': Parameter(
            unit='-',
            low=1.0 / MOST_PERMEABILITY_FACTOR,
            high=MOST_PERMEABILITY_FACTOR,
            neutral=1.0,
        ),
    },
    shape=('x', 'z', 'x_end', 'z_end', 'width'),
    on_rig=change_line,
    is_repeatable=True,
    blind_draw=draw,
)
