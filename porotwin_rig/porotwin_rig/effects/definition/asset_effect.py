"""An effect of the virtual rig: how it acts on the simulation and on the photographs."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.blind_draw import Draw
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.tracer import Tracer
from porotwin_rig.true_rig import TrueRig

FloatArray = NDArray[np.floating]

GUIDE = 'docs/extend/effect.md'
"""The document that explains how to write an effect."""

LAST = 1000
"""Position of effects that do not ask for another one: behind all that do."""

OnRig = Callable[[TrueRig, Values], TrueRig]
"""Returns the changed rig."""

RateFactor = Callable[[Values, float, float], float]
"""Returns the mean factor of the rate of `values['well']` between two times [s]."""

OnTracer = Callable[[Tracer, TrueRig, Values, float], Tracer]
"""Returns the tracer after a reaction of the given duration [s]."""

OnVisible = Callable[[FloatArray, FloatArray, Values, float], FloatArray]
"""Returns the visible tracer after a duration [s], from that before and the dissolved tracer."""

OnSignal = Callable[[FloatArray, Grid, float, Values], FloatArray]
"""Returns the changed signal (nz, nx) of the photograph at a time [s]."""


def share_after(since: float, start: float, end: float) -> float:
    """Return the share of the time from `start` to `end` [s] that is after `since` [s]."""
    return min(max(end - since, 0.0) / (end - start), 1.0)


@dataclass(frozen=True, kw_only=True)
class AssetEffect:
    """An effect of the virtual rig; each attribute `on_...` is a place where it may act.

    Args:
        name: name of the effect and of its module.
        parameters: its parameters; a default changes nothing.
        shape: those that say where or how it acts, not how much.
        on_rig: acts on the coefficients of the simulation.
        rate_factor: acts on the rate of one well.
        stock_factor: acts on the concentration that one well injects, likewise.
        tube_ml: water in the tube of one well [ml].
        on_tracer: a reaction, half before and half after the transport of every step.
        on_visible: delays the visible tracer.
        on_signal: acts on the brightness of the signal.
        on_picture: displaces the picture; acts on a finer grid after all signals.
        removes_tracer: whether the reaction removes tracer.
        is_repeatable: whether several act together; otherwise the last one counts.
        needs_recording: whether it needs a recording and cannot act in a live rig.
        longest_step: longest time step with the effect [s], for effects that change the flow in
            time or act between transport steps.
        order: position among effects that act at the same place.
        blind_draw: draws parameters for the blind check; only for effects outside the library.
        equal_to: for the same effects: library effects that make the same maps.

    Raises:
        InputError: the definition is not complete.
    """

    name: str
    parameters: Mapping[str, Parameter]
    shape: tuple[str, ...] = ()
    on_rig: OnRig | None = None
    rate_factor: RateFactor | None = None
    stock_factor: RateFactor | None = None
    tube_ml: Callable[[Values], float] | None = None
    on_tracer: OnTracer | None = None
    on_visible: OnVisible | None = None
    on_signal: OnSignal | None = None
    on_picture: OnSignal | None = None
    removes_tracer: bool = False
    is_repeatable: bool = False
    needs_recording: bool = False
    longest_step: float = math.inf
    order: int = LAST
    blind_draw: Draw | None = None
    equal_to: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse an incomplete definition."""
        of_a_well = (self.rate_factor, self.stock_factor, self.tube_ml)
        actions = (
            self.on_rig,
            *of_a_well,
            self.on_tracer,
            self.on_visible,
            self.on_signal,
            self.on_picture,
        )
        faults = {
            'parameters: give at least one': not self.parameters,
            'give one of on_rig, rate_factor, stock_factor, tube_ml, on_tracer, on_visible, '
            'on_signal, on_picture': not any(actions),
            'shape: name some of the parameters': not set(self.shape) <= set(self.parameters),
            "parameters: a change of one well needs 'well'": (
                any(of_a_well) and 'well' not in self.parameters
            ),
        }
        found = '; '.join(fault for fault, present in faults.items() if present)
        if found:
            raise InputError(f"effect '{self.name}' is incomplete: {found}; see {GUIDE}")

    def changes_nothing(self, values: Values) -> bool:
        """Return whether the effect has no consequence with all its `values`."""
        return all(
            values[key] in (parameter.neutral, parameter.default)
            for key, parameter in self.parameters.items()
            if not parameter.is_name and key not in self.shape
        )
