"""A layer conducts better along x than along z: by sqrt(ratio) along x, 1 / sqrt(ratio) along z."""

import math
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def stretch(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with the layer between the heights `z_low` and `z_high`."""
    x, z = rig.element_places
    inside = (z >= values['z_low']) & (z <= values['z_high'])
    factor = np.where(inside, math.sqrt(values['ratio']), 1.0) * np.ones_like(x)
    return replace(rig, anisotropies=(*rig.anisotropies, factor))


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a layer at the height of the injector, 12 to 20 cm thick on the small rig."""
    middle = context.injector.z_m
    half = generator.uniform(0.06, 0.1) * context.size
    ratio = log_uniform(generator, 1.25, 1.8) ** random_sign(generator)
    return {'z_low': max(middle - half, 0.0), 'z_high': middle + half, 'ratio': ratio}


EFFECT = AssetEffect(
    name='anisotropy',
    order=230,
    parameters={
        'z_low': Parameter(unit='m'),
        'z_high': Parameter(unit='m'),
        'ratio': Parameter(unit='-', above=0.0, neutral=1.0),
    },
    shape=('z_low', 'z_high'),
    on_rig=stretch,
    is_repeatable=True,
    blind_draw=draw,
)
