"""Blinded cases: experiments on the virtual rig whose effects the diagnosis does not know."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from lab.blind.blind_effects import ALIKE, PAIR_GROUPS, drawn_alike, equal_names
from porotwin_cli.running.drawn_effects import LIBRARY, OUTSIDE, drawn
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Boundaries, EffectDescription, Rig, Well, rig_from_maps
from porotwin_rig.virtual_rig import VirtualRig

SMALL = Rig(
    name='small',
    width_m=0.934,
    height_m=0.562,
    depth_m=0.010,
    porosity=0.375,
    permeability_m2=6.57e-10,
    viscosity_pa_s=1.0e-3,
    density_kg_m3=998.0,
    boundaries=Boundaries(),
    wells={
        'injector': Well(x_m=0.235, z_m=0.235),
        'producer': Well(x_m=0.660, z_m=0.160),
        'control1': Well(x_m=0.120, z_m=0.420),
        'control2': Well(x_m=0.500, z_m=0.375),
        'control3': Well(x_m=0.760, z_m=0.460),
    },
)
"""The paper's small rig with its nominal properties."""

KINDS = (
    *('none', 'single', 'outside', 'single', 'pair', 'single', 'left out', 'single', 'none'),
    *('single', 'outside', 'single', 'pair', 'single', 'single', 'left out', 'pair', 'single'),
    *('none', 'outside'),
)
"""Kinds of cases in their order: of 20, nine with one effect of the library, three each with none,
with a pair and with an effect from outside, and two with an effect that is left out of it."""

SEVERAL = ('three', 'alike')
"""Kinds of cases of a check of combinations: three effects, or two of one kind."""

LEFT_OUT = tuple(name for name in LIBRARY if name not in ('porosity', 'retardation'))
"""Effects that may be left out of the library: no other effect equals one of them."""

LARGE_EVERY = 11
"""One of this many cases is on the large rig; such a case takes much longer."""

SMALL_CELL_M, LARGE_CELL_M = 0.005, 0.01
"""Widths of the cells of the maps [m], for the small and the large rig."""

LARGE_NAME, LARGE_WIDTH_M, LARGE_PORES_M3 = 'large', 2.8, 0.0333
"""Name, width [m] and pore volume [m^3] of the large rig of the check."""

SMALL_INTERVAL_S, LARGE_INTERVAL_S = 60.0, 300.0
"""Intervals between photographs [s], for the small and the large rig."""


COARSE_ELEMENT = 0.42
"""Elements of the virtual rig of a coarse case per cell of its maps, as in other cases."""

LAYERED_ELEMENTS = 930
"""Elements along the longer side of the virtual rig if a real rig is given, with its layers of
sand. On the large FluidFlower an element is then 3 mm, and maps differ by 1.6 to 2.8 % from those
of the model on cells of 4 mm. Elements of 8.4 mm gave 4 to 6 %: a gap by itself."""


@dataclass(frozen=True)
class BlindCase:
    """An experiment and its hidden truth.

    Attributes:
        name: name of the case and of its folder.
        kind: one of `KINDS` or `SEVERAL`.
        effects: the true effects.
        right: names of the verdicts that are right.
        rig: the nominal rig description, which the diagnosis knows.
        schedule: commanded rates.
        duration: duration of the experiment [s].
        photo_interval: interval between photographs [s].
        cell_m: width of a cell of the maps [m].
        seed: seed of the noise.
        withheld: effects that the diagnosis must not consider.
        element_m: size of the elements of the virtual rig [m]; None: its default.
    """

    name: str
    kind: str
    effects: tuple[EffectDescription, ...]
    right: tuple[str, ...]
    rig: Rig
    schedule: Schedule
    duration: float
    photo_interval: float
    cell_m: float
    seed: int
    withheld: tuple[str, ...] = ()
    element_m: float | None = None

    def virtual_rig(self, effects: Sequence[EffectDescription]) -> VirtualRig:
        """Return the virtual rig of the case with these `effects`, before anything was pumped.

        Raises:
            InputError: an effect is not known or impossible.
        """
        return VirtualRig(self.rig, effects=effects, cell=self.element_m)


def draw_case(
    number: int,
    seed: int,
    rig: Rig | None = None,
    kinds: Sequence[str] = KINDS,
    *,
    coarse: bool = False,
) -> BlindCase:
    """Return case `number` of the check with `seed`, on `rig` or on one of the rigs of the check.

    `kinds` and effects follow in a fixed order; parameters, rates and noise are drawn at random.
    `coarse` makes the cells of the maps and of the virtual rig twice as large.

    Raises:
        InputError: `rig` has no well.
    """
    generator = np.random.default_rng([seed, number])
    large = rig is not None or number % LARGE_EVERY == LARGE_EVERY - 1
    longer = max(rig.width_m, rig.height_m) if rig else None
    rig = rig or (large_rig() if large else SMALL)
    if not rig.wells:
        raise InputError(f"rig '{rig.name}' has no well; add wells to rig.yaml")
    schedule, duration, wells = (_large_schedule if large else small_schedule)(generator, rig)
    injected = max(row.rate.rate for row in schedule.rows) / from_ml_h(1.0)
    context = DrawContext(rig, wells, duration, injected)
    cell = LARGE_CELL_M * rig.width_m / LARGE_WIDTH_M if large else SMALL_CELL_M
    turn = number % len(kinds)
    kind = kinds[turn]
    # the number of this case among all of its kind; another seed starts at another effect
    index = number // len(kinds) * kinds.count(kind) + kinds[:turn].count(kind) + 5 * seed
    names = names_of_kind(kind, index, generator)
    effects: tuple[EffectDescription, ...]
    if kind == 'alike':
        rates = {well: _largest_rate(schedule, well) for well in wells}
        effects = drawn_alike(names[0], generator, context, rates)
    else:
        effects = tuple(drawn(name, generator, context) for name in names)
    return BlindCase(
        name=f'case_{number:03d}',
        kind=kind,
        effects=effects,
        right=right_names(kind, effects),
        rig=rig,
        schedule=schedule,
        duration=duration,
        photo_interval=LARGE_INTERVAL_S if large else SMALL_INTERVAL_S,
        cell_m=2.0 * cell if coarse else cell,
        element_m=_element(2.0 * cell if coarse else None, longer),
        seed=int(generator.integers(2**31)),
        withheld=names if kind == 'left out' else (),
    )


def coarse_case(
    name: str,
    kind: str,
    effect: EffectDescription,
    right: str,
    schedule: Schedule,
    duration: float,
    seed: int,
) -> BlindCase:
    """Return a case of the small rig with one `effect` on cells of 1 cm, a map each minute.

    The arguments are as in `BlindCase`; `right` is the only right verdict.
    """
    cell, interval = LARGE_CELL_M, SMALL_INTERVAL_S
    return BlindCase(
        name, kind, (effect,), (right,), SMALL, schedule, duration, interval, cell, seed,
        element_m=cell * COARSE_ELEMENT,
    )  # fmt: skip


def _element(coarse_cell: float | None, longer_side: float | None) -> float | None:
    """Return the size of the elements of the virtual rig [m]; None: its default.

    `coarse_cell` is the width of a cell of a coarse case [m], `longer_side` that of a given rig.
    """
    if longer_side is not None:
        return longer_side / LAYERED_ELEMENTS
    return coarse_cell * COARSE_ELEMENT if coarse_cell is not None else None


def names_of_kind(kind: str, index: int, generator: Generator) -> tuple[str, ...]:
    """Return the names of the effects of case `index` of its `kind`."""
    if kind == 'none':
        return ()
    if kind in ('pair', 'three'):
        count = 2 if kind == 'pair' else 3
        groups = generator.choice(len(PAIR_GROUPS), count, replace=False)
        return tuple(str(generator.choice(PAIR_GROUPS[group])) for group in groups)
    if kind == 'alike':
        return (ALIKE[index % len(ALIKE)],)
    turns = {'single': tuple(LIBRARY), 'outside': tuple(OUTSIDE), 'left out': LEFT_OUT}[kind]
    return (turns[index % len(turns)],)


def _largest_rate(schedule: Schedule, well: str) -> float:
    """Return the largest commanded rate of `well` [m^3/s]."""
    return max(abs(row.rate.rate) for row in schedule.rows if row.well == well)


def right_names(kind: str, effects: tuple[EffectDescription, ...]) -> tuple[str, ...]:
    """Return the names of the verdicts that are right for a case with `effects`."""
    if kind == 'none':
        return ('none',)
    if kind == 'left out':
        return ('unexplained',)
    if kind == 'outside':
        return ('unexplained', *equal_names(effects[0]))
    return tuple(name for effect in effects for name in equal_names(effect))


def large_rig() -> Rig:
    """Return a rig as large as the large FluidFlower rig, with wavy layers of five sands."""
    nz, nx = 150, 280
    width, height = LARGE_WIDTH_M, 1.5
    x = (np.arange(nx) + 0.5) * width / nx
    z = (np.arange(nz) + 0.5) * height / nz
    wave = 0.05 * np.sin(2 * np.pi * x / width) - 0.02 * np.cos(6 * np.pi * x / width)
    level = z[:, None] - wave[None, :]
    bottoms = (-1.0, 0.16, 0.48, 0.80, 1.02, 1.18)
    sands = (1.1e-9, 6.0e-9, 2.0e-9, 4.2e-9, 1.8e-10, 4.2e-9)
    permeability: FloatArray = np.zeros((nz, nx))
    for bottom, sand in zip(bottoms, sands, strict=True):
        permeability[level > bottom] = sand
    data = {
        'name': LARGE_NAME,
        'width_m': width,
        'height_m': height,
        'viscosity_pa_s': 1.0e-3,
        'density_kg_m3': 998.0,
        'boundaries': Boundaries(),
        'wells': {
            'injector': Well(x_m=0.9, z_m=0.33),
            'injector2': Well(x_m=1.75, z_m=0.70),
        },
    }
    return rig_from_maps(
        data, {'depth_m': 0.018, 'porosity': 0.44, 'permeability_m2': permeability}
    )


def _large_schedule(generator: Generator, rig: Rig) -> tuple[Schedule, float, tuple[str, ...]]:
    """Return schedule, duration [s] and wells: slugs of tracer, some of them chased by water.

    Rates are in proportion to the pores of the rig.
    """
    duration = float(1800 * generator.integers(8, 13))
    rate = float(generator.uniform(1800, 2500))
    if rig.name != LARGE_NAME:
        rate *= rig.pore_volume / LARGE_PORES_M3
    first, second = (tuple(rig.wells) * 2)[:2]
    rows: list[ScheduleRow] = []

    def slug(start: float, well: str, length: float) -> None:
        chase = 0.0 if generator.random() < 0.7 else 0.4 * rate
        for time, ml_h, share in ((start, rate, 1.0), (start + length, chase, 0.0)):
            rows.append(ScheduleRow(time, well, WellRate(from_ml_h(ml_h), share)))

    slug(0.0, first, 1800.0)
    slug(0.25 * duration, second, 1800.0)
    slug(0.5 * duration, first, 1200.0)
    slug(0.75 * duration, second, 1200.0)
    return Schedule(tuple(rows)), duration, tuple(dict.fromkeys((first, second)))


def small_schedule(generator: Generator, _rig: Rig) -> tuple[Schedule, float, tuple[str, ...]]:
    """Return schedule, duration [s] and wells: tracer with pauses, a chase or a rest, two control
    wells whose rates change three times."""
    duration = float(60 * generator.integers(45, 75))
    injected = float(generator.uniform(350, 520))
    style = generator.choice(['paper', 'pulses', 'chase', 'rest'])
    controls = list(generator.choice(['control1', 'control2', 'control3'], 2, replace=False))
    rows: list[ScheduleRow] = []

    def command(time: float, well: str, rate_ml_h: float, concentration: float = 0.0) -> None:
        rows.append(ScheduleRow(time, well, WellRate(from_ml_h(rate_ml_h), concentration)))

    command(0.0, 'injector', injected, 1.0)
    parts = np.sort(generator.uniform(0.2, 0.9, 3)) * duration
    for time in (0.0, *(float(part) for part in parts)):
        shares = generator.uniform(0, 250, 2)
        for well, rate in zip(controls, shares, strict=True):
            command(time, str(well), float(rate))
        produced = float(shares.sum()) + injected * float(generator.uniform(0.3, 1))
        command(time, 'producer', -produced)
    if style == 'pulses':
        for index in range(2):
            command(duration * (0.25 + 0.35 * index), 'injector', 0.0, 1.0)
            command(duration * (0.35 + 0.35 * index), 'injector', injected, 1.0)
    elif style == 'chase':
        command(duration * float(generator.uniform(0.4, 0.6)), 'injector', injected, 0.0)
    elif style == 'rest':
        stop = duration * float(generator.uniform(0.5, 0.65))
        rows = [row for row in rows if row.time < stop]
        for well in ('injector', 'producer', *controls):
            command(stop, str(well), 0.0, 0.0)
    return Schedule(tuple(rows)), duration, ('injector', *map(str, controls))
