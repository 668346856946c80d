"""The section `control` of `rig.yaml`: the control wells, their limits, and the objective."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Self

import pydantic
from pydantic import Field, GetJsonSchemaHandler, JsonValue
from pydantic.json_schema import JsonSchemaValue

from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.plausibility import LEAST_RATE_ML_H
from porotwin_core.basis.spans import is_within
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, MINUTE_S
from porotwin_core.rig.numbers import (
    NotNegative,
    NotNegativeRate,
    Positive,
    PositiveRate,
    Rate,
    Share,
)
from porotwin_core.rig.sections import Point, Section, ZoneFile, check_corners, refuse_files

DEFAULT_OBJECTIVE = 'keep_out'
"""The objective of a rig that names none: keep the tracer out of a zone (paper, section 4)."""

PUMP_STEP_ML_H = 0.1
"""Resolution of a pump's display [ml/h], unless `rate_step_ml_h` says otherwise."""

CHANGE_COST_ML_MIN = 0.3
"""Worth of one order less, unless `change_cost_ml_min` says otherwise: 0.3 ml of tracer where it
must not be, for a minute. On the small rig a wrong setting costs more within a minute."""

LONGEST_EXPERIMENT_MIN = LONGEST_EXPERIMENT_S / MINUTE_S
"""Longest experiment [min]."""

MOST_CYCLES = 10_000
"""Most cycles of one well: one a minute for a week."""


class FixedWell(Section):
    """A well whose rate the twin does not change; it injects `concentration` (0 water, 1 stock)."""

    rate_ml_h: Rate = Field(description='rate [ml/h]; positive injects, negative produces')
    concentration: Share = Field(
        0.0, description='concentration of the injected water: 0 water, 1 tracer stock'
    )
    pauses_min: tuple[tuple[NotNegative, Positive], ...] = Field(
        (), description='announced pauses: start and end of each after the start [min]'
    )

    on_min: Positive | None = Field(
        None, description='instead of pauses_min: how long it pumps in each cycle [min]'
    )
    every_min: Positive | None = Field(
        None, description='length of a cycle with on_min [min], until control.end_min'
    )
    from_min: NotNegative = Field(
        0.0, description='begin of the first cycle with on_min [min]; it rests before'
    )

    @pydantic.model_validator(mode='after')
    def _has_whole_cycles(self) -> Self:
        if self.on_min is None and self.every_min is None:
            if self.from_min:
                raise ValueError('from_min begins the cycles of on_min and every_min; give both')
            return self
        if self.on_min is None or self.every_min is None or self.on_min >= self.every_min:
            raise ValueError('cycles need on_min and a longer every_min, such as 7 and 14')
        if self.pauses_min:
            raise ValueError('pauses_min and on_min both tell when it rests; keep one')
        return self

    def with_cycles_as_pauses(self, end_min: float) -> Self:
        """Return this well with the pauses of its cycles up to `end_min`."""
        if self.on_min is None or self.every_min is None:
            return self
        number = (end_min - self.from_min) / self.every_min  # infinite for the shortest cycles
        if number > MOST_CYCLES:
            raise ValueError(
                f'{number:.6g} cycles of {self.every_min:g} min: take at most {MOST_CYCLES}'
            )
        if self.from_min + self.every_min > end_min:
            raise ValueError(
                f'a cycle of {self.every_min:g} min from {self.from_min:g} min on lasts longer '
                f'than end_min {end_min:g}; write minutes, or pauses_min'
            )
        cycles = math.ceil(number)
        begins = [self.from_min + number * self.every_min for number in range(cycles)]
        rests = [(0.0, self.from_min)] if self.from_min else []
        rests += [(begin + self.on_min, begin + self.every_min) for begin in begins]
        # by round-off a rest may end just before the experiment, and then the well would run on
        rests = [(low, end_min if math.isclose(high, end_min) else high) for low, high in rests]
        pauses = tuple((low, min(high, end_min)) for low, high in rests if low < end_min)
        told = {'on_min': None, 'every_min': None, 'from_min': 0.0, 'pauses_min': pauses}
        return self.model_copy(update=told)

    @pydantic.model_validator(mode='after')
    def _injects_what_has_a_concentration(self) -> Self:
        if self.rate_ml_h < 0.0 and self.concentration > 0.0:
            raise ValueError(
                f'takes out {-self.rate_ml_h:g} ml/h, but has the concentration '
                f'{self.concentration:g} of injected water; give an injector a positive rate_ml_h, '
                'a producer no concentration'
            )
        return self

    def is_paused(self, minute: float) -> bool:
        """Return whether the well is in a pause at a `minute` after the start."""
        return is_within(minute, self.pauses_min)

    @pydantic.field_validator('pauses_min')
    @classmethod
    def _pauses_end_later(
        cls, pauses: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        before: tuple[float, float] | None = None
        for start, end in sorted(pauses):
            told = f'a pause from {start:g} to {end:g} min'
            if end <= start:
                raise ValueError(f'{told}: its end must be later')
            if end > LONGEST_EXPERIMENT_MIN:
                raise ValueError(f'{told}: no experiment is longer than a year; correct it')
            if before is not None and start < before[1]:
                raise ValueError(
                    f'{told} overlaps the one from {before[0]:g} to {before[1]:g} min; join them'
                )
            before = start, end
        return tuple(sorted(pauses))


class ObjectiveDescription(Section):
    """The objective of the controller: its name, and its parameters as given in `rig.yaml`.

    In `rig.yaml` it is a name (`keep_out`), or a mapping of the name and the parameters
    (`{name: keep_in, zone_m: [...]}`). The hub checks name and parameters, because it knows the
    objectives (`porotwin_hub.objectives.objective_registry`).
    """

    name: str = DEFAULT_OBJECTIVE
    parameters: dict[str, JsonValue] = Field(default_factory=dict)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: Any, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return the schema of the forms in `rig.yaml`: a name, or a mapping with a name."""
        name = {'type': 'string', 'description': 'name of the objective, such as keep_out'}
        mapping = {'type': 'object', 'properties': {'name': name}, 'required': ['name']}
        return {'anyOf': [name, mapping]}

    @pydantic.model_serializer
    def _to_yaml(self) -> str | dict[str, Any]:
        return {'name': self.name, **self.parameters} if self.parameters else self.name


class Control(Section):
    """The wells that the twin may set, their limits, and the objective (paper, section 4).

    The optimiser chooses the rates of `wells`, which inject water. `producer` takes out all of the
    injected water, so the net rate is zero; it is optional in a rig with an open side.
    `disallowed_zone_m` is a polygon and `fuzziness_m` a distance: the parameters of `keep_out`,
    and of every other objective that has a parameter of the same name.
    """

    wells: tuple[str, ...] = Field(
        description='names of the control wells: the twin chooses their rates, they inject water'
    )
    producer: str | None = Field(
        None, description='name of the well that takes out the sum of all injection'
    )
    fixed: dict[str, FixedWell] = Field(
        default_factory=dict, description='wells whose rates the twin does not change, by name'
    )
    max_rate_ml_h: PositiveRate = Field(
        500.0, description='largest rate of one control well [ml/h]'
    )
    max_total_rate_ml_h: PositiveRate = Field(
        500.0, description='largest sum of the rates of the control wells [ml/h]'
    )
    max_producer_rate_ml_h: PositiveRate | None = Field(
        None, description='largest rate that the producer takes out [ml/h]; default: no limit'
    )
    stock_ml: Positive | None = Field(
        None, description='tracer stock in the bottle at the start [ml]; default: enough'
    )
    rate_step_ml_h: PositiveRate = Field(
        PUMP_STEP_ML_H, description='rates are multiples of it, as the pumps are set [ml/h]'
    )
    min_rate_ml_h: NotNegativeRate = Field(
        0.0, description='smallest rate of a control well that pumps [ml/h]'
    )
    max_change_ml_h: PositiveRate | None = Field(
        None, description='largest change of one rate from one setpoint to the next [ml/h]'
    )
    change_cost_ml_min: NotNegative = Field(
        CHANGE_COST_ML_MIN,
        description='an order is given only if it is worth this much [ml min of the objective]',
    )
    end_min: Positive | None = Field(
        None, description='end of the experiment, after its start [min]; none: open'
    )
    objective: ObjectiveDescription = Field(
        ObjectiveDescription(), description='objective of the controller: a name, or {name:, ...}'
    )
    disallowed_zone_m: tuple[Point, ...] = Field(
        (), description='corners (x, z) of the zone without tracer [m], for keep_out'
    )
    zone: ZoneFile | None = Field(
        None, description='the zone of the objective as a picture or a map, instead of corners'
    )
    fuzziness_m: NotNegative = Field(
        0.1, description='distance [m] over which the cost falls to 0 beside a zone'
    )

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

    @pydantic.model_validator(mode='after')
    def _cycles_are_pauses(self) -> Self:
        """Turn cycles into pauses, which all others know."""
        cyclic = [name for name, well in self.fixed.items() if well.every_min is not None]
        if cyclic and self.end_min is None:
            raise ValueError(f'fixed.{cyclic[0]}: cycles need the end of the experiment, end_min')
        if cyclic and self.end_min is not None:
            fixed = {}
            for name, well in self.fixed.items():
                try:
                    fixed[name] = well.with_cycles_as_pauses(self.end_min)
                except ValueError as error:
                    raise ValueError(f'fixed.{name}: {error}') from None
            object.__setattr__(self, 'fixed', fixed)
        return self

    @pydantic.model_validator(mode='after')
    def _rates_can_be_set(self) -> Self:
        greatest, step = self.max_rate_ml_h, self.rate_step_ml_h
        if 'rate_step_ml_h' in self.model_fields_set and step > greatest:
            raise ValueError(f'rate_step_ml_h {step:g} is above max_rate_ml_h {greatest:g}')
        if step < LEAST_RATE_ML_H:
            raise ValueError(f'rate_step_ml_h {step:g}: no pump has such a step; correct it')
        if self.min_rate_ml_h > greatest:
            raise ValueError(
                f'min_rate_ml_h {self.min_rate_ml_h:g} is above max_rate_ml_h {greatest:g}'
            )
        least = step * max(1, math.ceil(self.min_rate_ml_h / step - WRITTEN_ROUND_OFF))
        if self.model_fields_set & {'rate_step_ml_h', 'min_rate_ml_h'}:
            if least > greatest * (1.0 + WRITTEN_ROUND_OFF):
                raise ValueError(
                    f'min_rate_ml_h {self.min_rate_ml_h:g}: no multiple of rate_step_ml_h {step:g} '
                    f'lies between it and max_rate_ml_h {greatest:g}; change one of the three'
                )
            if least > self.max_total_rate_ml_h * (1.0 + WRITTEN_ROUND_OFF):
                raise ValueError(
                    f'max_total_rate_ml_h {self.max_total_rate_ml_h:g} is below {least:g} ml/h, '
                    'the smallest rate that the pumps can be set to; raise it, or lower '
                    'min_rate_ml_h or rate_step_ml_h'
                )
        if self.max_change_ml_h is not None and self.max_change_ml_h < least * (
            1 - WRITTEN_ROUND_OFF
        ):
            raise ValueError(
                f'max_change_ml_h {self.max_change_ml_h:g} is below {least:g} ml/h, the smallest '
                'rate that the pumps can be set to: no well could ever start; raise it'
            )
        return self

    @pydantic.model_validator(mode='after')
    def _pauses_end_in_time(self) -> Self:
        for name, well in self.fixed.items():
            for start, end in well.pauses_min:
                if self.end_min is not None and end > self.end_min:
                    raise ValueError(
                        f'fixed.{name}.pauses_min: a pause from {start:g} to {end:g} min ends '
                        f'after end_min {self.end_min:g}; correct one of them'
                    )
        return self

    @property
    def most_fixed_ml_h(self) -> float:
        """The largest sum of the rates of the fixed wells [ml/h], by their pauses."""
        edges = {edge for w in self.fixed.values() for pause in w.pauses_min for edge in pause}
        last = math.inf if self.end_min is None else self.end_min
        return max(
            math.fsum(w.rate_ml_h for w in self.fixed.values() if not w.is_paused(minute))
            for minute in (0.0, *edges)
            if minute < last
        )

    @property
    def most_total_ml_h(self) -> float:
        """The largest sum of the rates of the control wells that the producer can take [ml/h]."""
        if self.max_producer_rate_ml_h is None:
            return self.max_total_rate_ml_h
        return min(self.max_total_rate_ml_h, self.max_producer_rate_ml_h - self.most_fixed_ml_h)

    @property
    def most_taken_ml_h(self) -> float:
        """The largest rate that the producer can be ordered to take out [ml/h]."""
        return max(self.most_total_ml_h + self.most_fixed_ml_h, 0.0)

    @property
    def most_total_words(self) -> str:
        """`most_total_ml_h` with its origin."""
        most = self.most_total_ml_h
        if most == self.max_total_rate_ml_h:
            return f'{most:g} ml/h, max_total_rate_ml_h'
        return (
            f'{most:g} ml/h, which max_producer_rate_ml_h {self.max_producer_rate_ml_h:g} leaves '
            f'beside the fixed wells with {self.most_fixed_ml_h:g}'
        )

    @pydantic.model_validator(mode='after')
    def _spares_the_producer(self) -> Self:
        most = self.max_producer_rate_ml_h
        if most is not None and self.producer is None:
            raise ValueError('max_producer_rate_ml_h: there is no producer; name one, or remove it')
        if most is not None and self.most_fixed_ml_h > most:
            raise ValueError(
                f'max_producer_rate_ml_h {most:g}: the fixed wells alone inject '
                f'{self.most_fixed_ml_h:g} ml/h, which {self.producer} must take out; correct one'
            )
        return self

    @pydantic.model_validator(mode='after')
    def _leaves_no_injection_to_the_producer(self) -> Self:
        takes_out = any(well.rate_ml_h < 0.0 for well in self.fixed.values())
        if self.producer is None or not takes_out:
            return self
        starts = {start for well in self.fixed.values() for start, _ in well.pauses_min}
        for minute in sorted({0.0, *starts}):
            net = math.fsum(w.rate_ml_h for w in self.fixed.values() if not w.is_paused(minute))
            if net < -PUMP_STEP_ML_H * WRITTEN_ROUND_OFF:
                raise ValueError(
                    f'fixed wells take out {-net:g} ml/h more than they inject'
                    + (f' in the pause at {minute:g} min' if minute > 0.0 else '')
                    + f', so that {self.producer} would have to inject while the control wells are '
                    'off; correct the signs of their rates, or let another well balance them'
                )
        return self

    @pydantic.model_validator(mode='after')
    def _has_one_zone(self) -> Self:
        if self.zone is not None and self.disallowed_zone_m:
            raise ValueError('zone and disallowed_zone_m both give the zone; keep one')
        return self

    @pydantic.field_validator('end_min')
    @classmethod
    def _is_an_experiment(cls, end_min: float | None) -> float | None:
        if end_min is not None and end_min > LONGEST_EXPERIMENT_MIN:
            raise ValueError(
                f'no experiment is longer than {LONGEST_EXPERIMENT_MIN:g} min, a year; give '
                'minutes after its start, or leave it out for an open end'
            )
        return end_min

    @pydantic.field_validator('disallowed_zone_m', mode='before')
    @classmethod
    def _is_no_file(cls, value: Any) -> Any:
        return refuse_files(value)

    @pydantic.field_validator('disallowed_zone_m')
    @classmethod
    def _is_polygon(cls, points: tuple[Point, ...]) -> tuple[Point, ...]:
        return check_corners(points) if points else points

    def with_pauses(
        self, pauses_min: Mapping[str, Sequence[tuple[float, float]]], end_min: float | None
    ) -> Self:
        """Return this section with other pauses of the fixed wells, up to another end [min]."""
        end = math.inf if end_min is None else end_min
        fixed = {
            name: well.model_copy(
                update={
                    'pauses_min': tuple(
                        (start, min(stop, end))
                        for start, stop in pauses_min.get(name, ())
                        if start < end
                    )
                }
            )
            for name, well in self.fixed.items()
        }
        return self.model_copy(update={'fixed': fixed, 'end_min': end_min})

    def until(self, end_min: float) -> Self:
        """Return this section for an experiment that ends at `end_min`, with its pauses."""
        return self.with_pauses({name: w.pauses_min for name, w in self.fixed.items()}, end_min)

    def check_wells(self, known: dict[str, Any], *, closed: bool) -> Self:
        """Return `self` after a check: all wells are `known` and each has one role.

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
