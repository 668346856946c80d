"""The recordings of a store: small ones, of two rigs, of every kind, some with weak gaps."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lab.blind.blind_cases import SMALL, BlindCase, names_of_kind, right_names, small_schedule
from lab.blind.blind_effects import drawn_alike
from porotwin_cli.running.drawn_effects import drawn
from porotwin_core.basis.units import to_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription, Rig, Well, rig_from_maps
from porotwin_solver.effects import EFFECTS

WEAK = 'weak'
"""A kind of case: one effect, with `WEAK_SHARE` of the strength that is drawn."""

OVER_TIME = 'over time'
"""A kind of case: one of `TIMED`, which no library has."""

TIMED = ('pump_drift', 'pulsation', 'water_table')
"""Effects outside the library that change with time."""

KINDS = (
    *('single', 'pair', WEAK, 'single', 'none', 'single', 'alike', 'single', 'outside', WEAK),
    *('pair', 'single', 'none', 'single', 'pair', WEAK, 'single', 'none', 'single', 'alike'),
    *('single', 'outside', WEAK, 'pair', 'three', 'left out', OVER_TIME, 'pair', 'outside', WEAK),
    *('left out', OVER_TIME, 'single', 'three', WEAK, 'left out', 'pair', 'outside', OVER_TIME),
    *('none', 'single', 'three', 'left out', WEAK, 'alike', 'pair', 'single', 'outside', 'none'),
)
"""Kinds of cases in their order; their number shares no divisor with the next two."""

WEAK_SHARE = 0.5
"""Strength of the effect of a weak gap, relative to the one that was drawn."""

TWO_SANDS_EVERY = 4
"""One of this many recordings is of the rig with two sands."""

HELD_OUT_EVERY = 3
"""One of this many recordings is held out: no rule is chosen by it."""

COLUMNS = 81
"""Cells of the maps along the longer side: the fewest that are not scant."""

ELEMENTS_PER_CELL = 0.42
"""Elements of the virtual rig per cell of the maps, as in a coarse blind check."""

INTERVAL_S = 60.0
"""Interval of the maps [s]."""


def two_sands() -> Rig:
    """Return a rig of 60 x 40 cm with a coarse sand above a fine one."""
    nz, nx = 80, 120
    sand = np.full((nz, nx), 1.2e-9)
    x = np.arange(nx)
    for row in range(nz):
        sand[row, row < 26 + 5 * np.sin(2.0 * np.pi * x / nx)] = 3.5e-10
    scale = (0.6 / SMALL.width_m, 0.4 / SMALL.height_m)
    data = {
        'name': 'two sands',
        'width_m': 0.6,
        'height_m': 0.4,
        'viscosity_pa_s': 1.0e-3,
        'density_kg_m3': 998.0,
        'boundaries': SMALL.boundaries,
        'wells': {
            name: Well(x_m=well.x_m * scale[0], z_m=well.z_m * scale[1])
            for name, well in SMALL.wells.items()
        },
    }
    maps: dict[str, float | FloatArray] = {
        'depth_m': 0.01,
        'porosity': 0.36,
        'permeability_m2': sand,
    }
    return rig_from_maps(data, maps)


def draw_stored(number: int, seed: int) -> BlindCase:
    """Return recording `number` of the store with `seed`, with its truth.

    Effects follow in a fixed order; parameters, rates and noise are drawn at random.
    """
    generator = np.random.default_rng([seed, number])
    rig = two_sands() if number % TWO_SANDS_EVERY == TWO_SANDS_EVERY - 1 else SMALL
    schedule, duration, wells = small_schedule(generator, rig)
    schedule = _times(schedule, rig.pore_volume / SMALL.pore_volume)
    turn = number % len(KINDS)
    kind = KINDS[turn]
    effects = _effects(kind, number, seed, generator, (rig, wells, duration, schedule))
    cell = max(rig.width_m, rig.height_m) / COLUMNS
    return BlindCase(
        name=f'case_{number:03d}',
        kind=kind,
        effects=effects,
        right=right_names({WEAK: 'single', OVER_TIME: 'outside'}.get(kind, kind), effects),
        rig=rig,
        schedule=schedule,
        duration=duration,
        photo_interval=INTERVAL_S,
        cell_m=cell,
        seed=int(generator.integers(2**31)),
        withheld=tuple(effect.name for effect in effects) if kind == 'left out' else (),
        element_m=cell * ELEMENTS_PER_CELL,
    )


def _effects(
    kind: str,
    number: int,
    seed: int,
    generator: np.random.Generator,
    experiment: tuple[Rig, Sequence[str], float, Schedule],
) -> tuple[EffectDescription, ...]:
    """Return the effects of recording `number`, of a `kind`, in this `experiment`."""
    rig, wells, duration, schedule = experiment
    largest = {
        well: max(abs(row.rate.rate) for row in schedule.rows if row.well == well) for well in wells
    }
    context = DrawContext(rig, tuple(wells), duration, to_ml_h(largest[wells[0]]))
    alone = kind in ('single', WEAK)
    own = ('single', WEAK) if alone else (kind,)
    turns = [one in own for one in KINDS]
    index = number // len(KINDS) * sum(turns) + sum(turns[: number % len(KINDS)]) + 5 * seed
    if kind == OVER_TIME:
        return (drawn(TIMED[index % len(TIMED)], generator, context),)
    names = names_of_kind('single' if alone else kind, index, generator)
    if kind == 'alike':
        return drawn_alike(names[0], generator, context, largest)
    effects = tuple(drawn(name, generator, context) for name in names)
    return tuple(map(weakened, effects)) if kind == WEAK else effects


def weakened(effect: EffectDescription) -> EffectDescription:
    """Return `effect` with `WEAK_SHARE` of its strength; its place and its well stay."""
    values = dict(effect.parameters)
    for name, value in values.items():
        parameter = EFFECTS[effect.name].parameters[name]
        if isinstance(value, str) or not parameter.is_scored:
            continue
        if parameter.is_logarithmic and parameter.neutral > 0.0:
            ratio = value / parameter.neutral
            values[name] = parameter.neutral * ratio**WEAK_SHARE
        else:
            values[name] = parameter.neutral + WEAK_SHARE * (value - parameter.neutral)
    return EffectDescription(name=effect.name, parameters=values)


def _times(schedule: Schedule, factor: float) -> Schedule:
    """Return `schedule` with all rates times `factor`."""
    return Schedule(
        tuple(
            replace(row, rate=replace(row.rate, rate=row.rate.rate * factor))
            for row in schedule.rows
        )
    )
