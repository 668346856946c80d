"""All candidates of a search on recordings of one rig, from the registry of effects."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from porotwin_core.model.gauge_reading import GaugeKind
from porotwin_core.rig import Rig
from porotwin_diagnosis.data.sample import Sample
from porotwin_solver.effects import EFFECTS, effects_of
from porotwin_solver.effects.definition.candidate import Candidate, SearchContext
from porotwin_solver.effects.definition.effect import Effect, Scope


def library(samples: Sequence[Sample]) -> list[Candidate]:
    """Return the candidates of all effects for recordings of one rig.

    Effects of the rig come first, then wells, the camera, and effects with a place, which start in
    the middle of the rig. Steps that follow from the duration are those for the longest recording.
    An effect in `rig.yaml` starts from its values there.
    """
    longest = search_context(samples, max(samples, key=lambda sample: sample.duration))
    first = search_context(samples, samples[0])
    at_wells = [replace(first, well=name) for name in first.pumping_wells]
    rig = first.rig
    return [
        *_candidates(effects_of(Scope.RIG), longest, rig),
        *(found for well in at_wells for found in _candidates(effects_of(Scope.WELL), well, rig)),
        *_candidates(effects_of(Scope.CAMERA), longest, rig),
        *_candidates(effects_of(Scope.PLACE), first, rig),
    ]


def beginnings(samples: Sequence[Sample]) -> list[Candidate]:
    """Return the candidates of effects that may begin during recordings of one rig."""
    context = search_context(samples, samples[0])
    contexts = [
        (context, effects_of(Scope.RIG, Scope.CAMERA)),
        *((replace(context, well=n), effects_of(Scope.WELL)) for n in context.pumping_wells),
    ]
    return [found for own, effects in contexts for one in effects for found in one.begins(own)]


def search_context(samples: Sequence[Sample], sample: Sample) -> SearchContext:
    """Return the context of search parameters.

    It holds rig, grid and duration of `sample`, and the wells that pump in any of `samples`."""
    return SearchContext(
        rig=sample.rig,
        grid=sample.grid,
        duration=sample.duration,
        pumping_wells=tuple(pumping_wells(samples)),
        measures_pressure=any(
            one.kind is GaugeKind.PRESSURE for each in samples for one in each.readings
        ),
        tracer_wells=tuple(
            dict.fromkeys(
                row.well
                for one in samples
                for row in one.schedule.rows
                if row.rate.rate > 0.0 and row.rate.concentration > 0.0
            )
        ),
        strongest_rate=max((abs(row.rate.rate) for row in sample.schedule.rows), default=0.0),
    )


def pumping_wells(samples: Sequence[Sample]) -> list[str]:
    """Return the names of the wells that pump in any of `samples`."""
    return [
        name
        for name in samples[0].rig.wells
        if any(row.well == name and row.rate.rate for s in samples for row in s.schedule.rows)
    ]


def nominal_parameters(rig: Rig, effect: str) -> dict[str, float | str] | None:
    """Return the parameters in `rig.yaml` of an effect that replaces its description.

    None if `rig.yaml` does not have the effect, or if the effect adds to the description.
    """
    if not EFFECTS[effect].replaces_nominal:
        return None
    own = (described for described in reversed(rig.effects) if described.name == effect)
    return next((described.parameters for described in own), None)


def _candidates(effects: Sequence[Effect], context: SearchContext, rig: Rig) -> list[Candidate]:
    return [
        _from_nominal(candidate, rig)
        for effect in effects
        for candidate in effect.candidates(context)
    ]


def _from_nominal(candidate: Candidate, rig: Rig) -> Candidate:
    """Return `candidate` starting from its parameters in `rig.yaml`, clipped to their range."""
    own = nominal_parameters(rig, candidate.effect)
    if own is None:
        return candidate
    scaled = tuple(
        parameter.scaled(
            float(
                np.clip(own.get(parameter.name, parameter.neutral), parameter.low, parameter.high)
            )
        )
        for parameter in candidate.parameters
    )
    fixed = {name: own.get(name, value) for name, value in candidate.fixed.items()}
    return replace(candidate, fixed=fixed, starts=(scaled,))
