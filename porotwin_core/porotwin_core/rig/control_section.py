"""The section `control` of `rig.yaml`: the control wells, their limits, and the objective."""

from typing import Annotated, Any, Self

import pydantic
from pydantic import Field, FiniteFloat, JsonValue

from porotwin_core.rig.sections import Point, Positive, Section, check_corners

DEFAULT_OBJECTIVE = 'keep_out'
"""The objective of a rig that names none: keep the tracer out of a zone (paper, section 4)."""


class FixedWell(Section):
    """A well whose rate the twin does not change; it injects `concentration` (0 water, 1 stock)."""

    rate_ml_h: FiniteFloat
    concentration: Annotated[FiniteFloat, Field(ge=0, le=1)] = 0.0


class ObjectiveDescription(Section):
    """The objective of the controller: its name, and its parameters as given in `rig.yaml`.

    In `rig.yaml` it is a name (`keep_out`), or a mapping of the name and the parameters
    (`{name: keep_in, zone_m: [...]}`). The hub checks name and parameters, because it knows the
    objectives (`porotwin_hub.objective_registry`).
    """

    name: str = DEFAULT_OBJECTIVE
    parameters: dict[str, JsonValue] = Field(default_factory=dict)

    @pydantic.model_serializer
    def _to_yaml(self) -> str | dict[str, Any]:
        return {'name': self.name, **self.parameters} if self.parameters else self.name


class Control(Section):
    """The wells that the twin may set, their limits, and the objective (paper, section 4).

    The optimiser chooses the rates of `wells`, which inject water. `producer` takes out the sum of
    all injected water, so that the net rate is zero; a rig with an open side may do without one.
    `disallowed_zone_m` is a polygon and `fuzziness_m` a distance: the parameters of `keep_out`,
    and of every other objective that has a parameter of the same name.
    """

    wells: tuple[str, ...]
    producer: str | None = None
    fixed: dict[str, FixedWell] = Field(default_factory=dict)
    max_rate_ml_h: Positive = 500.0
    max_total_rate_ml_h: Positive = 500.0
    objective: ObjectiveDescription = ObjectiveDescription()
    disallowed_zone_m: tuple[Point, ...] = ()
    fuzziness_m: Annotated[FiniteFloat, Field(ge=0)] = 0.1

    @pydantic.field_validator('objective', mode='before')
    @classmethod
    def _is_name_or_mapping(cls, value: Any) -> Any:
        if isinstance(value, str):
            return {'name': value}
        if isinstance(value, dict):
            if 'name' not in value:
                raise ValueError('needs a name, such as {name: keep_in, zone_m: [...]}')
            parameters = {key: item for key, item in value.items() if key != 'name'}
            return {'name': value['name'], 'parameters': parameters}
        if isinstance(value, ObjectiveDescription):
            return value
        raise ValueError('give a name, or {name: keep_in, zone_m: [...]}')

    @pydantic.field_validator('disallowed_zone_m')
    @classmethod
    def _is_polygon(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        return check_corners(points) if points else points

    def check_wells(self, known: dict[str, Any], *, closed: bool) -> Self:
        """Return `self` if its wells are `known` and each has one role.

        Args:
            known: the wells of the rig by name.
            closed: whether all sides of the rig are closed.

        Raises:
            ValueError: a well is unknown or has two roles, or a closed rig has no producer.
        """
        producer = () if self.producer is None else (self.producer,)
        roles = [*self.wells, *producer, *self.fixed]
        for name in roles:
            if name not in known:
                raise ValueError(
                    f"control names an unknown well '{name}'; known: {', '.join(known)}"
                )
            if roles.count(name) > 1:
                raise ValueError(f"control gives well '{name}' two roles; keep one")
        if not producer and closed:
            raise ValueError('control needs a producer: every side of the rig is closed')
        return self
