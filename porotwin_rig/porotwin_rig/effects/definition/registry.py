"""Every effect of the virtual rig by name, and sets of effects with their parameters."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from porotwin_core.basis.discovery import discovered
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.plausibility import rate_remark
from porotwin_core.basis.text_with_unit import plain_number
from porotwin_core.model.effect_parameter import (
    Values,
    check_places,
    checked_values,
    known_effects,
    written_effect,
)
from porotwin_core.rig import EffectDescription, Rig
from porotwin_rig.effects.definition.asset_effect import GUIDE, AssetEffect
from porotwin_rig.true_rig import TrueRig

PACKAGE = __package__.removesuffix('.definition')
"""The package whose modules are effects."""


@dataclass(frozen=True)
class EffectSet:
    """Effects with their parameters, complete and checked, in the order of their action."""

    members: tuple[tuple[AssetEffect, Values], ...] = ()

    @classmethod
    def checked(cls, described: Iterable[EffectDescription], rig: Rig) -> 'EffectSet':
        """Return the `described` effects of `rig`.

        Of an effect that is not repeatable only the last one counts.

        Raises:
            InputError: an effect, a parameter or a well is not known, or a value is out of range.
        """
        given: dict[str, list[Values]] = {}
        for description in described:
            given.setdefault(description.name, []).append(_checked(description, rig))
        found = (
            (effect, values)
            for effect in EFFECTS.values()
            for values in given.get(effect.name, [])[None if effect.is_repeatable else -1 :]
        )
        return cls(tuple(found))

    def __iter__(self) -> Iterator[tuple[AssetEffect, Values]]:
        return iter(self.members)

    @property
    def longest_step(self) -> float:
        """Longest time step that all effects allow [s]."""
        return min((effect.longest_step for effect, _ in self.members), default=math.inf)

    def applied(self, true_rig: TrueRig) -> TrueRig:
        """Return `true_rig` changed by all effects that act on it.

        Raises:
            InputError: the result is no possible rig.
        """
        for effect, values in self.members:
            if effect.on_rig is not None:
                true_rig = effect.on_rig(true_rig, values)
        return true_rig.checked()

    def rate_factor(self, well: str, *, start: float, end: float) -> float:
        """Return the mean true over metered rate of `well` from `start` to `end` [s]."""
        return math.prod(
            effect.rate_factor(values, start, end)
            for effect, values in self.members
            if effect.rate_factor is not None and values['well'] == well
        )

    def stock_factor(self, well: str, *, start: float, end: float) -> float:
        """Return the mean true over commanded concentration of `well`, likewise."""
        return math.prod(
            effect.stock_factor(values, start, end)
            for effect, values in self.members
            if effect.stock_factor is not None and values['well'] == well
        )

    def tube_ml(self, well: str) -> float:
        """Return the water in the tube of `well` [ml]."""
        return math.fsum(
            effect.tube_ml(values)
            for effect, values in self.members
            if effect.tube_ml is not None and values['well'] == well
        )


def _checked(description: EffectDescription, rig: Rig) -> Values:
    name = description.name
    if name not in EFFECTS:
        raise InputError(f"effect '{name}' is not known; {known_effects(name, EFFECTS)}")
    check_places(name, description.parameters, rig.width_m, rig.height_m)
    values = checked_values(name, EFFECTS[name].parameters, description.parameters)
    well = values.get('well')
    if well is not None and well not in rig.wells:
        raise InputError(
            f"effect '{name}' names an unknown well '{well}'; known: {', '.join(rig.wells)}"
        )
    return values


def refuse_slips(described: Iterable[EffectDescription], rig: Rig) -> None:
    """Check the `described` effects of `rig` for slips of the hand, since they will be hidden.

    Raises:
        InputError: an effect has no consequence, is given twice where one would count or both
            would multiply, pumps more than a rig stands, or is refused by `EffectSet.checked`.
    """
    seen: set[tuple[str, object]] = set()
    for description in described:
        values = _checked(description, rig)
        effect = EFFECTS[description.name]
        names = [key for key, parameter in effect.parameters.items() if parameter.is_name]
        key = (effect.name, tuple(values[name] for name in names))
        differ_in_place = effect.is_repeatable and effect.shape and not names
        if key in seen and not differ_in_place:
            raise InputError(f'effect {effect.name}: is given twice; keep one')
        seen.add(key)
        _refuse_flood(effect, values, rig)
        if effect.changes_nothing(values):
            strengths = [key for key in values if key not in (*effect.shape, *names)]
            words = ', '.join(f'{key} = {values[key]:g}' for key in strengths)
            raise InputError(
                f'effect {description.name}: changes nothing with {words}; give another value'
            )


def _refuse_flood(effect: AssetEffect, values: Values, rig: Rig) -> None:
    for key, parameter in effect.parameters.items():
        if parameter.unit == 'ml/h':
            remark = rate_remark(f'effect {effect.name}: {key}', values[key], rig.pore_volume)
            if remark is not None and remark.refused:
                raise InputError(str(remark))


def parse_effects(text: str) -> tuple[EffectDescription, ...]:
    """Return the effects written as `NAME:PARAMETER=VALUE,...;NAME:...` on a command line.

    Raises:
        InputError: the text is not of that form.
    """
    effects = []
    for part in filter(None, (piece.strip() for piece in text.split(';'))):
        name, given = written_effect(part)
        parameters = {key: _value(value) for key, value in given.items()}
        effects.append(EffectDescription(name=name, parameters=parameters))
    return tuple(effects)


def _value(text: str) -> float | str:
    number = plain_number(text)
    return number if math.isfinite(number) else text


def _found() -> dict[str, AssetEffect]:
    """Return the effects of the package in their order.

    Raises:
        InputError: a module is no complete effect.
    """
    effects = discovered(PACKAGE, 'EFFECT', AssetEffect, GUIDE)
    return dict(sorted(effects.items(), key=lambda item: (item[1].order, item[0])))


EFFECTS: dict[str, AssetEffect] = _found()
"""All effects by name, in the order of their action."""
