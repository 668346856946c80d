"""The class of effects: all that the simulation, the search and the reports know about one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from porotwin_core.basis.errors import InputError
from porotwin_core.model.blind_draw import Draw
from porotwin_core.model.effect_parameter import (
    SINCE,
    Parameter,
    Values,
    changed_values,
    checked_values,
)
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.coefficients.observation_operator import ObservationOperator
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Beliefs, Candidates, PlaceSearch
from porotwin_solver.effects.definition.words import reading

GUIDE = 'docs/extend/effect.md'
"""The document that explains how to write an effect."""

LAST = 1000
"""Position of effects that do not ask for another one: behind all that do."""


class Scope(Enum):
    """The part of the experiment that has the effect."""

    MODEL = 'model'
    """The numerical scheme itself; found by comparing schemes, not by a search."""
    RIG = 'rig'
    """The whole rig."""
    WELL = 'well'
    """One well; the search tries every pumping well."""
    PLACE = 'place'
    """An unknown place in the rig, which the search finds first."""
    CAMERA = 'camera'
    """The camera."""


class Appearance(Enum):
    """How an effect shows in the maps. The blind check draws the two effects of a pair from two
    different groups; effects of one group imitate each other."""

    DELAY = 'fronts arrive early or late'
    FADING = 'the plume is paler or darker'
    SHIFT = 'the plume is displaced'
    BENDING = 'the plume takes another path'
    SPREADING = 'fronts are wider'


class Process(Enum):
    """The process that the effect changes, in the words of a physicist."""

    SOURCE = 'source'
    """Water or tracer enters or leaves."""
    TRANSPORT = 'transport'
    """Tracer takes another way, or spreads."""
    STORAGE = 'storage'
    """The sand holds more or less tracer."""
    CAMERA = 'camera'
    """The picture shows something else."""


def _no_candidates(_context: object) -> tuple[()]:
    return ()


def _no_doubt(_rig: Rig) -> tuple[()]:
    return ()


def _equal_to_none(_values: Values) -> tuple[str, ...]:
    return ()


def _no_obstacle(_physics: Physics, _parameter: str) -> str:
    return ''


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One effect that a rig, its camera or the model may have and `rig.yaml` does not describe.

    The effect acts either through `on_physics` or through `on_observation`.

    Args:
        name: name of the effect and of its module.
        scope: the part of the experiment that has it.
        parameters: its parameters by name.
        on_physics: returns the changed physics.
        on_observation: returns the changed observation operator.
        candidates: returns the candidates of a search. With `Scope.WELL` it is called once per
            pumping well, `context.well`.
        begins: returns the candidates that a search gives an onset, likewise; their parameters do
            not name `SINCE`. An effect with an onset acts in full from there on.
        believed: returns the prior of its parameters on a rig.
        places: how the search finds the place; for `Scope.PLACE` only.
        phrase: states the effect with these values in words, as HTML.
        laboratory_check: how to check the effect without the camera.
        blind_draw: draws parameters for the blind check; None where it draws no such case.
        plainly: the effect in ordinary words, where its name is a technical term.
        changes: the process that it changes; follows from the scope for wells and the camera.
        appearance: how it shows; None where the blind check draws no pair with it.
        pales_core: whether it makes the core of a plume paler or darker. A calibration on the same
            rig takes this core for stock, and so hides a part of the effect.
        equal_to: returns the names of the effects that no map can tell from this one.
        also: another cause of the same maps, outside the library.
        order: position in lists, in searches and in the draws of the blind check.
        present: returns the values that the physics has already, for an effect that replaces its
            own description in `rig.yaml`; None for one that adds to it.
        needs_simulation: without, it acts on maps that are simulated already.
        moves_time: photographs show the rig at another time than they say.
        is_slow_on_fine_grids: a simulation on a large fine grid takes minutes.
        misfit_allowance: factor on the misfit that the true effect may leave; above 1 where the
            model computes the effect on coarser cells.
        is_learnable: COSTA may learn it from recordings, on top of what the model has of it.
        gradient_obstacle: returns why the adjoint cannot differentiate by a parameter, with the
            remedy; empty where it can.

    Raises:
        InputError: the definition is not complete.
    """

    name: str
    scope: Scope
    parameters: Mapping[str, Parameter]
    phrase: Callable[[Values], str]
    laboratory_check: str
    on_physics: Callable[[Physics, Values], Physics] | None = None
    on_observation: Callable[[ObservationOperator, Values], ObservationOperator] | None = None
    candidates: Candidates = _no_candidates
    begins: Candidates = _no_candidates
    believed: Beliefs = _no_doubt
    places: PlaceSearch | None = None
    blind_draw: Draw | None = None
    plainly: str = ''
    changes: Process = Process.TRANSPORT
    appearance: Appearance | None = None
    pales_core: bool = False
    equal_to: Callable[[Values], tuple[str, ...]] = _equal_to_none
    also: str = ''
    order: int = LAST
    present: Callable[[Physics], Values] | None = None
    needs_simulation: bool = True
    moves_time: bool = False
    is_slow_on_fine_grids: bool = False
    misfit_allowance: float = 1.0
    is_learnable: bool = False
    gradient_obstacle: Callable[[Physics, str], str] = _no_obstacle

    def __post_init__(self) -> None:
        """Refuse an incomplete definition."""
        faults = {
            'parameters: give at least one': not self.parameters,
            'on_physics, on_observation: give one of the two': (
                (self.on_physics is None) == (self.on_observation is None)
            ),
            'scope: an effect has on_observation exactly if it is of the camera': (
                self.is_of_camera != (self.on_observation is not None)
            ),
            'laboratory_check: say how to check it': not self.laboratory_check,
            'candidates: without them no diagnosis finds it': (
                not self.is_diagnosed and self.believed is _no_doubt
            ),
            'places: needed for an effect with a place, and only for one': (
                self.has_place != (self.places is not None)
            ),
            f"parameters: an effect that begins needs '{SINCE}'": (
                self.begins is not _no_candidates and SINCE not in self.parameters
            ),
            "parameters: an effect of a well needs 'well'": (
                self.scope is Scope.WELL and 'well' not in self.parameters
            ),
        }
        found = '; '.join(fault for fault, present in faults.items() if present)
        if found:
            raise InputError(f"effect '{self.name}' is incomplete: {found}; see {GUIDE}")

    @property
    def is_of_camera(self) -> bool:
        """Whether the camera has the effect, not the rig."""
        return self.scope is Scope.CAMERA

    @property
    def is_diagnosed(self) -> bool:
        """Whether a diagnosis may name it: after a search, or after comparing schemes."""
        searched = {self.candidates, self.begins} != {_no_candidates}
        return self.scope is Scope.MODEL or searched

    @property
    def replaces_nominal(self) -> bool:
        """Whether it replaces its own description in `rig.yaml`; other effects add to it."""
        return self.present is not None

    @property
    def process(self) -> Process:
        """The process that the effect changes."""
        by_scope = {Scope.CAMERA: Process.CAMERA, Scope.WELL: Process.SOURCE}
        return by_scope.get(self.scope, self.changes)

    @property
    def has_place(self) -> bool:
        """Whether the search must find a place in the rig."""
        return self.scope is Scope.PLACE

    def checked(self, given: Mapping[str, object]) -> dict[str, float | str]:
        """Return all parameters, in range, where `given` names some of them.

        Raises:
            InputError: an unknown, missing or impossible parameter, by name, value and remedy.
        """
        return checked_values(self.name, self.parameters, given)

    def on_top(self, physics: Physics, given: Mapping[str, object]) -> Physics:
        """Return `physics` with the `given` changes on top of what it has of the effect.

        Factors multiply, other numbers add. A parameter that is not given does not change.

        Raises:
            InputError: an unknown or impossible parameter, or a sum out of range.
        """
        if self.on_physics is None:
            return physics
        neutral = {name: one.neutral for name, one in self.parameters.items() if not one.is_name}
        values = changed_values(self.name, self.parameters, {**neutral, **given})
        if self.present is not None:
            present = self.present(physics)
            total = {
                name: one.on_top(present[name], float(values[name]))
                for name, one in self.parameters.items()
            }
            values = self.checked(total)
        return self.on_physics(physics, values)

    def change(self, physics: Physics, given: Mapping[str, object]) -> EffectDescription:
        """Return the effect that is `given` as a change of what `physics` has; see `on_top`.

        Raises:
            InputError: as `checked`.
        """
        values = self.checked(given)
        if self.present is not None:
            present = self.present(physics)
            changes = {
                name: one.change(present[name], float(values[name]))
                for name, one in self.parameters.items()
            }
            values = {n: c for n, c in changes.items() if c != self.parameters[n].neutral}
        return self.described(**values)

    def described(self, **given: float | str) -> EffectDescription:
        """Return the description of the effect with these parameters."""
        return EffectDescription(name=self.name, parameters=given)

    def change_in_words(self, given: Mapping[str, float | str]) -> str:
        """Return the `given` parameters of a change, each in the unit of reports."""
        parts = []
        for name, value in given.items():
            factor, unit = reading(self.parameters[name])
            shown = value if isinstance(value, str) else f'{factor * value:.3g}'
            parts.append(f'{name} {shown} {unit}'.rstrip())
        return f'{self.name}: {", ".join(parts)}'

    def in_words(self, given: Mapping[str, object]) -> str:
        """Return the effect with all parameters as plain text; `given` names some of them.

        Raises:
            InputError: as `checked`.
        """
        return self.phrase(self.checked(given))
