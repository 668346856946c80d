"""The effect that a virtual rig hides from its twin: named by a person, or drawn as a surprise."""

import numpy as np
from numpy.random import Generator

from porotwin_cli.running.drawn_effects import LIBRARY, OUTSIDE, drawn
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import relative_error
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.rates.water_levels import WaterLevels
from porotwin_core.rates.wells import with_rises
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.rig.coarse_grid import coarse_grid
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_rig.effects import EFFECTS as RIG_EFFECTS
from porotwin_rig.effects import parse_effects, refuse_slips
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.effects import EFFECTS
from porotwin_solver.model.model import Model

SURPRISE = 'surprise'
"""The word for an effect that the seed draws."""

MENDABLE = tuple(
    name
    for name in LIBRARY
    if not EFFECTS[name].is_of_camera and not RIG_EFFECTS[name].needs_recording
)
"""Effects that a live virtual rig can have and a solver can learn."""

SHOWN_AFTER_S = 1500.0
"""A surprise must show so long after the start, without control [s]: at the first diagnosis."""

LEAST_SHOWN = 0.08
"""Least difference of the map that a surprise makes by then, relative L2 [-]: several times the
error of a map from photographs."""

DRAWS = 12
"""Draws of an effect; the strongest one is hidden."""


def hidden_effect(text: str, rig: Rig, *, seed: int) -> EffectDescription:
    """Return the effect that `text` names: NAME:PARAM=VALUE,..., NAME alone, or `surprise`.

    Parameters that are not given are drawn by the seed, strong enough to show.

    Args:
        text: the words of the user.
        rig: the rig that shall have the effect.
        seed: of the draw.

    Raises:
        InputError: the rig cannot have such an effect.
    """
    if ':' in text:
        return _given(text, rig)
    generator = np.random.default_rng([seed, *text.encode()])
    context = draw_context(rig)
    if text == SURPRISE:
        return surprise(MENDABLE, generator, context)
    if text not in {**LIBRARY, **OUTSIDE} or RIG_EFFECTS[text].needs_recording:
        known = ', '.join(sorted({*MENDABLE, *OUTSIDE}))
        raise InputError(f"hidden effect '{text}': unknown; choose {SURPRISE} or one of {known}")
    return surprise((text,), generator, context)


def _given(text: str, rig: Rig) -> EffectDescription:
    found = parse_effects(text)
    if len(found) != 1 or found[0].name not in RIG_EFFECTS:
        known = ', '.join(RIG_EFFECTS)
        raise InputError(f"hidden effect '{text}': name one of {known}, with its parameters")
    if RIG_EFFECTS[found[0].name].needs_recording:
        raise InputError(f"hidden effect '{text}': not on a live rig; choose another one")
    refuse_slips(found, rig)
    VirtualRig(rig, effects=found)  # refuses an impossible effect, such as a leak outside
    return found[0]


def draw_context(rig: Rig) -> DrawContext:
    """Return the context of draws for a controlled `rig`.

    Raises:
        InputError: the rig has no control section, or injects nothing.
    """
    control = rig.control
    if control is None or not control.fixed:
        raise InputError('hidden effect: the rig injects nothing; add control to rig.yaml')
    injected = sum(well.rate_ml_h for well in control.fixed.values())
    return DrawContext(rig, (*control.fixed, *control.wells), SHOWN_AFTER_S, injected)


def surprise(
    names: tuple[str, ...], generator: Generator, context: DrawContext
) -> EffectDescription:
    """Return an effect of one of `names` that shows in the maps of the first diagnoses.

    An effect that the solver does not know is drawn once: nothing tells how much it shows.

    Raises:
        InputError: none of them shows.
    """
    plain = _map(context.rig, ())
    for name in map(str, generator.permutation(names)):
        if name not in EFFECTS:
            return drawn(name, generator, context)
        trials = [drawn(name, generator, context) for _ in range(DRAWS)]
        shown = [relative_error(_map(context.rig, (trial,)), plain) for trial in trials]
        if max(shown) >= LEAST_SHOWN:
            return trials[int(np.argmax(shown))]
    raise InputError(
        f'hidden effect {" or ".join(names)}: does not show in this rig; choose another one'
    )


def _map(rig: Rig, effects: tuple[EffectDescription, ...]) -> np.ndarray:
    model = Model(rig, coarse_grid(rig, rig.default_grid()), preset='fast', effects=effects)
    rates = with_rises(Limits.of(rig).safe(), WaterLevels.of(rig).at(SHOWN_AFTER_S))
    return model.predict(model.initial_condition(), rates, SHOWN_AFTER_S)


def as_text(effect: EffectDescription) -> str:
    """Return an effect as the parameter of the virtual rig takes it."""
    values = ','.join(f'{name}={value}' for name, value in effect.parameters.items())
    return f'{effect.name}:{values}'
