"""Effects of the running model beyond rig.yaml: checked, and in words."""

from collections.abc import Iterable, Sequence

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.effects import effect
from porotwin_solver.effects.definition.effect import Scope

AS_DESCRIBED = 'the model as rig.yaml describes it'
"""The words for no effect."""


def checked_effects(
    rig: Rig, descriptions: Iterable[EffectDescription]
) -> tuple[EffectDescription, ...]:
    """Return effects with all their parameters, if the running model of `rig` can have them.

    Raises:
        InputError: an unknown effect, parameter or well, a value out of range, a place outside the
            rig, or an effect that no model of the flow has.
    """
    return tuple(_checked(rig, described) for described in descriptions)


def _checked(rig: Rig, described: EffectDescription) -> EffectDescription:
    found = effect(described.name)
    if found.is_of_camera:
        raise InputError(
            f"effect '{found.name}': is of the camera, and the solver makes no photographs; "
            'correct the camera or calibrate it again'
        )
    if found.scope is Scope.MODEL:
        raise InputError(
            f"effect '{found.name}': is of the numerical scheme; choose another --preset"
        )
    values = found.checked(described.parameters)
    well = values.get('well')
    if well is not None and well not in rig.wells:
        known = ', '.join(rig.wells)
        raise InputError(f"effect {found.name}: well '{well}' is not in rig.yaml; known: {known}")
    if found.has_place:
        _refuse_outside(rig, found.name, float(values['x']), float(values['z']))
    return EffectDescription(name=found.name, parameters=values)


def _refuse_outside(rig: Rig, name: str, x: float, z: float) -> None:
    if not (0.0 <= x <= rig.width_m and 0.0 <= z <= rig.height_m):
        raise InputError(
            f'effect {name}: x = {x:.3f} m, z = {z:.3f} m lies outside the rig of '
            f'{rig.width_m:g} m x {rig.height_m:g} m; name a place in it'
        )


def in_words(effects: Sequence[EffectDescription]) -> str:
    """Return the effects in plain words, such as `the injector delivers 30 % less`."""
    phrases = [effect(one.name).in_words(one.parameters) for one in effects]
    return ', and '.join(phrases) or AS_DESCRIBED
