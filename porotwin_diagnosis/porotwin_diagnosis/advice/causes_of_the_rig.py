"""Causes in the rig that do not change over time: the effects of the library, and two others."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.cause import Amounts, Cause, Place
from porotwin_diagnosis.advice.free_runs import FreeRuns
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.search.place_scan import trials_of
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects import EFFECTS, effects_of
from porotwin_solver.effects.definition.candidate import Candidate
from porotwin_solver.effects.definition.effect import Process, Scope
from porotwin_solver.effects.retardation import EFFECT as RETARDATION

TOLERANCE = 1.0
"""Steps that a fitted parameter may lie outside its range: responses are linear, maps are noisy."""

MOST_STEPS = 12.0
"""Largest number of steps of a parameter whose response is taken for linear."""

LEAST_SORPTION = -0.5
"""Least sorption of pale tracer beyond that of stock [-]: it moves twice as fast then."""

MOST_TRIALS = 6.0
"""Largest strength of a leak or a zone, relative to its trial: 30 % of the strongest pump."""

STRETCH = 1.05
"""Ratio of the heights of a stretched rig and of the rig: fronts move clearly, and nearly to first
order."""

SORPTION = 0.02
"""Retardation factor minus 1 whose response stands for the delay of pale tracer."""


def causes_of_the_library(runs: FreeRuns, excluded: Sequence[str] = ()) -> Iterator[Cause]:
    """Yield the effects of the library without a place, except those with an `excluded` name."""
    for candidate in library([runs.sample]):
        effect = EFFECTS[candidate.effect]
        if effect.has_place or effect.name in excluded:
            continue
        try:
            changes = _changes(runs, candidate)
        except InputError:  # the model cannot run with this effect
            continue
        yield Cause(
            candidate.label,
            effect.process,
            'steps',
            np.stack(changes),
            _words_of(candidate),
            _place_of(runs, candidate),
            len(changes),
            _range_of(candidate),
            effect.laboratory_check,
        )


def _changes(runs: FreeRuns, candidate: Candidate) -> list[FloatArray]:
    """Return the changes by one step of every parameter of `candidate`."""
    first = np.array(candidate.first, dtype=float)
    absent = candidate.is_absent(candidate.first)
    origin = runs.maps if absent else runs.with_effects(candidate.described(candidate.first))
    found: list[FloatArray] = []
    for index, parameter in enumerate(candidate.parameters):
        step = 1.0 if first[index] + 1.0 <= parameter.range[1] else -1.0
        moved = first.copy()
        moved[index] += step
        maps = runs.with_effects(candidate.described(moved.tolist()))
        found.append((maps - origin) / step)
    return found if absent else [np.asarray(origin - runs.maps)]


def _words_of(candidate: Candidate) -> Callable[[Amounts], str]:
    def words(amounts: Amounts) -> str:
        values = _described(candidate, amounts).parameters
        return EFFECTS[candidate.effect].phrase(values)

    return words


def _described(candidate: Candidate, amounts: Amounts) -> EffectDescription:
    """Return the effect with fitted amounts: steps, or the share of one that is never zero."""
    first = candidate.first
    if candidate.is_absent(first):
        return candidate.described([a + b for a, b in zip(first, amounts, strict=True)])
    strength = candidate.parameters[-1]
    scaled = (*first[:-1], strength.scaled(max(amounts[0], 1e-6) * strength.value(first[-1])))
    return candidate.described(scaled)


def _range_of(candidate: Candidate) -> Callable[[Amounts], bool]:
    """Return whether amounts lie in the ranges of the parameters, with a tolerance."""
    if not candidate.is_absent(candidate.first):
        return lambda amounts: amounts[0] > 0.0

    def allows(amounts: Amounts) -> bool:
        return all(
            abs(a) <= MOST_STEPS and low - TOLERANCE <= a + start <= high + TOLERANCE
            for a, start, (low, high) in zip(
                amounts, candidate.first, (one.range for one in candidate.parameters), strict=True
            )
        )

    return allows


def _place_of(runs: FreeRuns, candidate: Candidate) -> Place | None:
    """Return the place of the well of `candidate`, if it has one."""
    name = candidate.fixed.get('well')
    well = runs.sample.rig.wells.get(str(name))
    return None if well is None else (well.x_m, well.z_m)


def causes_at_places(
    runs: FreeRuns, excluded: Sequence[str] = (), pool: Executor | None = None
) -> Iterator[Cause]:
    """Yield leaks and zones at places all over the rig.

    A leak is tried with one sign, because its response is nearly linear; a zone is tried tight and
    permeable.
    """
    for effect in effects_of(Scope.PLACE):
        if effect.name in excluded:
            continue
        try:
            trials = trials_of(runs.sample, effect.name)
        except InputError:  # a closed rig cannot leak, or no pump runs
            continue
        if effect.process is Process.SOURCE:
            trials = trials[::2]
        described = [trial.described(trial.first) for trial in trials]
        run = map if pool is None else pool.map
        shown = run(runs.with_effects, described)
        for trial, one, maps in zip(trials, described, shown, strict=True):
            yield Cause(
                effect.name,
                effect.process,
                'of the trial',
                (maps - runs.maps)[None],
                _words_at_place(trial),
                (float(one.parameters['x']), float(one.parameters['z'])),
                len(trial.parameters),
                _strength_of(effect.process),
                effect.laboratory_check,
            )


def _strength_of(process: Process) -> Callable[[Amounts], bool]:
    """Return whether a trial may have a strength: water may be lost too, a zone stays itself."""
    if process is Process.SOURCE:
        return lambda amounts: 0.0 < abs(amounts[0]) <= MOST_TRIALS
    return lambda amounts: 0.0 < amounts[0] <= MOST_TRIALS


def _words_at_place(trial: Candidate) -> Callable[[Amounts], str]:
    def words(amounts: Amounts) -> str:
        scaled = (*trial.first[:-1], trial.first[-1] * amounts[0])
        return EFFECTS[trial.effect].phrase(trial.described(scaled).parameters)

    return words


def preferred_direction(runs: FreeRuns) -> Iterator[Cause]:
    """Yield a sand that conducts better along x than along z.

    With the conductivities K_x and K_z, z' = z sqrt(K_x / K_z) turns the rig into an isotropic one
    (Bear, Dynamics of Fluids in Porous Media, section 7.4). So a rig is run that is stretched
    upward, with as many cells and as much pore water.
    """
    rig = runs.sample.rig
    wells = {
        name: well.model_copy(update={'z_m': well.z_m * STRETCH})
        for name, well in rig.wells.items()
    }
    stretched = rig.model_copy(update={'height_m': rig.height_m * STRETCH, 'wells': wells})

    def same_water(physics: Physics) -> Physics:
        return replace(physics, porosity=physics.porosity / STRETCH)

    def words(amounts: Amounts) -> str:
        ratio = np.exp(2.0 * amounts[0])
        along = 'across than up' if ratio > 1 else 'up than across'
        return f'the sand conducts {max(ratio, 1 / ratio):.2f} times better {along}'

    try:
        maps = runs.with_rig(stretched, same_water)
    except InputError:  # an effect that is given has its place outside the stretched rig
        return
    change = (maps - runs.maps) / np.log(STRETCH)
    check = (
        'inject a short pulse from one well alone: round in an even sand, an ellipse in this one'
    )
    most = 0.5 * np.log(MOST_FACTOR)
    yield Cause(
        'preferred direction',
        Process.TRANSPORT,
        '-',
        change[None],
        words,
        allows=lambda amounts: abs(amounts[0]) <= most,
        own_check=check,
    )


def delay_of_pale_tracer(runs: FreeRuns) -> Iterator[Cause]:
    """Yield sorption that is stronger at low concentrations: a delay times 1 - c."""
    sorbed = RETARDATION.described(retardation_factor=1.0 + SORPTION)

    def words(amounts: Amounts) -> str:
        change = 100 * (1.0 / (1.0 + amounts[0]) - 1.0)
        speed = 'faster' if change > 0 else 'slower'
        return f'pale tracer moves {abs(change):.1f} % {speed} than stock'

    try:
        delay = (runs.with_effects(sorbed) - runs.maps) / SORPTION
    except InputError:
        return
    change = delay * (1.0 - np.clip(runs.maps, 0.0, 1.0))
    check = (
        'shake sand with stock and with diluted stock; compare the concentrations left in the water'
    )
    yield Cause(
        'pale tracer delayed',
        Process.STORAGE,
        '-',
        change[None],
        words,
        allows=lambda amounts: amounts[0] >= LEAST_SORPTION,
        own_check=check,
    )
