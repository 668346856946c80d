"""Derivatives of coefficients by the parameters of effects, as differences between models.

The coefficients are smooth functions of the parameters, so that a difference is right to about
eight digits. At the end of a parameter's range, such as a decay rate of 0, it is one-sided.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.effect_parameter import SINCE, onset
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.effects import effect
from porotwin_solver.model.model import Model

RELATIVE_STEP = 1e-5
"""Step of the differences relative to the parameter [-], absolute for a parameter of 0: near the
cube root of the round-off, where a central difference is most accurate."""

DIFFERENCES: tuple[Mapping[float, float], ...] = (
    {1.0: 0.5, -1.0: -0.5},
    {0.0: -1.5, 1.0: 2.0, 2.0: -0.5},
    {0.0: 1.5, -1.0: -2.0, -2.0: 0.5},
)
"""Weights by number of steps: central, forward and backward; all of second order."""

ParameterName = tuple[str, str]
"""The names of an effect and of its parameter."""


class ParameterDifference:
    """Models with one parameter changed by a small step, and the weights of their difference.

    The derivative of a quantity q is sum(weight q(model)) / step, of second order in the step.

    Attributes:
        step: the step, in the unit of the parameter.
        models: weight [-] of every model.
    """

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        preset: str,
        effects: tuple[EffectDescription, ...],
        name: ParameterName,
    ) -> None:
        """Make the models for the parameter `name` of one of the `effects`.

        The effects of `rig` itself are ignored; `effects` contains them.

        Raises:
            InputError: the parameter is absent or not a number, or has no room on either side.
        """
        effect_name, parameter = name
        values = [d.parameters.get(parameter) for d in effects if d.name == effect_name]
        if not values or not isinstance(values[0], (int, float)):
            raise InputError(
                f"gradient by {effect_name} '{parameter}': not a number among the effects; "
                'give the effect with all its parameters'
            )
        self.step = RELATIVE_STEP * (abs(values[0]) or 1.0)
        nominal = rig.model_copy(update={'effects': ()})

        def model(steps: float) -> Model:
            shifted = _shifted(effects, name, steps * self.step)
            return Model(nominal, grid, preset=preset, effects=shifted)

        for weights in DIFFERENCES:
            # a value outside the parameter's range is refused; the next difference avoids it
            with suppress(InputError):
                self.models = {model(steps): weight for steps, weight in weights.items()}
                return
        raise InputError(
            f'gradient by {effect_name} {parameter} = {values[0]:g}: no room to vary it on either '
            'side'
        )

    @property
    def reacts(self) -> bool:
        """Whether the parameter changes decay or the exchange with immobile water."""
        one, other, *_ = (model.engine.physics for model in self.models)
        return any(
            getattr(one, name) != getattr(other, name)
            for name in ('decay_rate', 'immobile_fraction', 'exchange_rate')
        )

    def derivative(self, value: Callable[[Model], float]) -> float:
        """Return the derivative of `value(model)` by the parameter, in their units."""
        return sum(weight * value(model) for model, weight in self.models.items()) / self.step


def refuse_unavailable(names: Sequence[ParameterName], model: Model) -> None:
    """Refuse parameters without a gradient, and models that change over time.

    Raises:
        InputError: an effect states an obstacle, such as diffusion where there is none; an effect
            has an onset, or a tube holds water.
    """
    for described in model.effects:
        if onset(described) > 0.0 or (described.name, SINCE) in names:
            raise InputError(
                f'gradient: {described.name} has an onset, which the adjoint cannot follow; leave '
                f"'{SINCE}' out"
            )
    physics = model.physics
    if any(physics.dead_volumes.values()):
        raise InputError(
            f'gradient: the tube of {", ".join(physics.dead_volumes)} delays the tracer, which the '
            'adjoint cannot follow; leave the effect out and delay the concentrations in the rates'
        )
    for name, parameter in names:
        obstacle = effect(name).gradient_obstacle(model.engine.physics, parameter)
        if obstacle:
            raise InputError(f'gradient by {name} {parameter}: {obstacle}')


def _shifted(
    effects: Iterable[EffectDescription], name: ParameterName, by: float
) -> list[EffectDescription]:
    """Return `effects` with the parameter of the first effect of that name changed `by` so much."""
    effect, parameter = name
    shifted, done = [], False
    for description in effects:
        if description.name == effect and not done:
            values = dict(description.parameters)
            values[parameter] = float(values[parameter]) + by
            shifted.append(EffectDescription(name=effect, parameters=values))
            done = True
        else:
            shifted.append(description)
    return shifted
