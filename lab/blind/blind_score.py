"""The score of one blinded case: its diagnosis compared with its truth."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lab.blind.blind_cases import BlindCase
from lab.blind.blind_effects import equal_names
from lab.blind.blind_truth import CaseTruth
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.report.named_rows import named_rows
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.effect import Effect

NEAR = 0.05
"""Distance within which one of two leaks or zones is found, relative to the width of the rig."""


@dataclass(frozen=True)
class CaseScore:
    """One case: the truth, the diagnosis, and whether it is right.

    Attributes:
        name: name of the case.
        kind: `none`, `single`, `pair`, `outside`, `left out`, `three` or `alike`.
        truth: names of its effects, or `none`.
        verdict: the verdict, or `failed`, or `refused` for a refused calibration.
        confidence: confidence of the verdict.
        right: whether the verdict is right.
        imitated: whether it is right only because it looks the same as the truth to the camera.
        listed: whether a verdict that is not right lists the truth among the effects that this
            recording cannot separate from it.
        all_found: whether all of several effects were found; None for other kinds.
        gap_closed: share of the gap that closes, against maps without noise; None without a gap.
        parameter_errors: relative errors of the parameters of the effects that were found.
        intervals_held: number of these parameters whose 90 % interval contains the truth.
        distance_m: distance of a local effect from its true place [m]; None for other effects.
        seconds: time that the diagnosis took [s]; None if it failed.
        absorbed: names of true effects that the calibration took out of the maps.
        gap: error of the model without effects in the held-out maps, in noise floors [-]; None if
            the diagnosis failed.
        visible: whether the true maps explain the recording clearly better than a diagnosis that is
            not right, or not complete; None for other cases.
    """

    name: str
    kind: str
    truth: tuple[str, ...]
    verdict: str
    confidence: float
    right: bool
    imitated: bool = False
    listed: bool = False
    all_found: bool | None = None
    gap_closed: float | None = None
    parameter_errors: tuple[float, ...] = ()
    intervals_held: int = 0
    distance_m: float | None = None
    seconds: float | None = None
    absorbed: tuple[str, ...] = ()
    gap: float | None = None
    visible: bool | None = None

    @property
    def confirmed(self) -> bool:
        """Whether what the confidence stands for is true.

        A confidence is the probability that the verdict is right, or one of the effects that the
        recording cannot separate from it.
        """
        return self.right or self.listed


def score_case(
    case: BlindCase, result: Path, truth: CaseTruth, hidden: frozenset[str] = frozenset()
) -> CaseScore:
    """Return the score of the diagnosis in the folder `result`.

    Right is the effect of the case; of a pair the stronger one, or either if both are equally
    strong. Another name is right too if it looks the same to the camera on the virtual rig. Effects
    that the calibration took out of the maps, `hidden`, need not be found: the names of the others
    are right, or `none` if there is no other. The share of the gap that closes is computed against
    the virtual rig's maps without noise, and not taken from the diagnosis.
    """
    stated = json.loads((result / 'diagnosis.json').read_text(encoding='utf-8'))
    verdict = str(stated['verdict'])
    parameters = list(_parameters(case, stated))
    right = verdict in truth.strongest or truth.imitated or verdict in verdicts_beside(case, hidden)
    return CaseScore(
        name=case.name,
        kind=case.kind,
        truth=_truth_names(case),
        verdict=verdict,
        confidence=float(stated['confidence']),
        right=right,
        listed=not right and bool({*truth.strongest} & {*stated['not_separable_from']}),
        absorbed=tuple(sorted(hidden)),
        imitated=truth.imitated,
        all_found=_all_found(case, stated, hidden) if len(case.effects) > 1 else None,
        gap_closed=truth.gap_closed,
        parameter_errors=tuple(error for error, _ in parameters),
        intervals_held=sum(inside for _, inside in parameters),
        distance_m=_distance(case, stated),
        seconds=float(stated['made_with']['seconds']),
        gap=float(stated['error']['before']) / max(float(stated['error']['noise_floor']), 1e-9),
    )


def failed_score(case: BlindCase, verdict: str = 'failed') -> CaseScore:
    """Return the score of a `case` that has no verdict: wrong, confidence 0.

    `verdict` is `failed`, or `refused` where the calibration was refused.
    """
    return CaseScore(
        name=case.name,
        kind=case.kind,
        truth=_truth_names(case),
        verdict=verdict,
        confidence=0.0,
        right=False,
        all_found=False if len(case.effects) > 1 else None,
    )


def _truth_names(case: BlindCase) -> tuple[str, ...]:
    return tuple(effect.name for effect in case.effects) or ('none',)


def verdicts_beside(case: BlindCase, hidden: frozenset[str]) -> tuple[str, ...]:
    """Return the verdicts that are right because effects of `case` are `hidden`."""
    if not hidden:
        return ()
    left = [effect for effect in case.effects if effect.name not in hidden]
    return tuple(name for effect in left for name in equal_names(effect)) or ('none',)


def _all_found(case: BlindCase, stated: Mapping[str, Any], hidden: frozenset[str]) -> bool:
    """Return whether every effect of `case`, or an equal one, is in the kept combination.

    Effects that are `hidden` need not be there. Of two alike both must be there, at their wells or
    near their places.
    """
    left = named_rows(stated, stated['combination'])
    for effect in case.effects:
        if effect.name in hidden:
            continue
        found = next((row for row in left if _is_found(case, effect, row)), None)
        if found is None:
            return False
        left.remove(found)
    return True


def _is_found(case: BlindCase, effect: EffectDescription, row: Mapping[str, Any]) -> bool:
    """Return whether `row` of a diagnosis means `effect`, one of the effects of `case`."""
    if row['name'] not in equal_names(effect):
        return False
    if case.kind != 'alike':
        return True
    values = {key: entry['value'] for key, entry in row['parameters'].items()}
    if 'well' in effect.parameters:
        return bool(values['well'] == effect.parameters['well'])
    apart = [values[key] - float(effect.parameters[key]) for key in ('x', 'z')]
    return float(np.hypot(*apart)) < NEAR * case.rig.width_m


def _parameters(case: BlindCase, stated: Mapping[str, Any]) -> Iterator[tuple[float, bool]]:
    """Yield the relative error of every parameter of the effects that were found, and whether its
    interval contains the truth."""
    named = named_rows(stated, stated['combination'])
    for effect in case.effects:
        rows = [row for row in named if row['name'] == effect.name]
        row = next((row for row in rows if _is_found(case, effect, row)), None)
        if row is None:
            continue
        found = row['parameters']
        true = _counted_parameters(effect, found)
        for name, value in true.items():
            low, high = found[name]['low'], found[name]['high']
            inside = low is not None and low <= value <= high
            stated_value = float(found[name]['value'])
            yield relative_parameter_error(EFFECTS[effect.name], name, true, stated_value), inside


def _counted_parameters(effect: EffectDescription, found: Mapping[str, Any]) -> dict[str, float]:
    return {
        name: value
        for name, value in effect.parameters.items()
        if EFFECTS[effect.name].parameters[name].is_scored
        and name in found
        and not isinstance(value, str)
    }


def relative_parameter_error(
    effect: Effect, name: str, true: Mapping[str, float], value: float
) -> float:
    """Return the error of `value`, relative to the true deviation from no effect.

    `true` holds the true parameters of the effect by name. Logarithmic parameters are compared on a
    logarithmic scale, components of a vector relative to its length.
    """
    truth, parameter = true[name], effect.parameters[name]
    if parameter.is_logarithmic:
        return float(abs(np.log(value / truth)) / abs(np.log(truth)))
    size = abs(truth - parameter.neutral)
    if parameter.vector:
        parts = [part for part, p in effect.parameters.items() if p.vector == parameter.vector]
        size = float(np.linalg.norm([true[part] for part in parts]))
    return abs(value - truth) / max(size, 1e-12)


def _distance(case: BlindCase, stated: Mapping[str, Any]) -> float | None:
    """Return the distance [m] of the stated place from the true one, for the named effect."""
    centre = stated['where']['centre']
    for effect in case.effects:
        if effect.name == stated['verdict'] and 'x' in effect.parameters and centre:
            dx = centre['x_m'] - float(effect.parameters['x'])
            dz = centre['z_m'] - float(effect.parameters['z'])
            return float(np.hypot(dx, dz))
    return None
