"""Scenarios of the closed loop: zones, wells, limits, hidden effects, faults, operators.

A scenario follows from its number and the seed alone. The places of wells and zone are drawn until
the nominal model says that there is something to control: without control much tracer reaches the
zone, and one control well alone keeps most of it out, but not all.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from porotwin_cli.bench_loop_operator import Operator
from porotwin_core.blind_draw import DrawContext
from porotwin_core.grid import FloatArray
from porotwin_core.polygons import inside
from porotwin_core.rig import (
    Boundaries,
    Control,
    EffectDescription,
    FixedWell,
    ObjectiveDescription,
    Polygon,
    Rig,
    Well,
)
from porotwin_core.zone_shapes import PolygonZone
from porotwin_hub.objective_registry import make_objective
from porotwin_hub.setpoint_limits import Limits
from porotwin_rig.effects import EFFECTS as RIG_EFFECTS
from porotwin_solver.model import Model
from porotwin_validation.blind_effects import LIBRARY, OUTSIDE, drawn

Point = tuple[float, float]

WIDTH_M, HEIGHT_M = 0.934, 0.562
"""Size of the paper's small rig [m]; all scenarios take place in a rig of this size."""

PAPER_PLACES: dict[str, Point] = {
    'injector': (0.235, 0.235),
    'producer': (0.660, 0.160),
    'control1': (0.120, 0.420),
    'control2': (0.500, 0.375),
    'control3': (0.760, 0.460),
}
"""Places of the wells in the paper (x, z) [m]."""

MOVED_M = 0.06
"""Greatest distance of a drawn well from its place in the paper, along each axis [m]."""

FOUR_WELLS = 0.3
"""Probability of one control well more."""

TRIAL_GRIDS = ((62, 37), (94, 56))
"""Columns and rows of the grids on which a drawn scenario is tried. The first one takes some
milliseconds; the second one smears less, so that a trivial scenario shows."""

COARSE_TIMES = 8
"""Times at which a trial looks at the zone."""

LEAST_FREE_ML = 8.0
"""Tracer in the zone at the end without control, at least [ml]: several times the error of a map of
a rig with 2 l of pores."""

ALONE_RANGE = (0.03, 0.25)
"""Dose with the best well alone at its maximum, relative to no control: below, any controller would
do; above, the wells are in wrong places, and a laboratory would move them."""

TRIALS = 2000
"""Most draws of the places of one scenario; about every hundredth one passes."""

WELL_CLEARANCE_M = 0.09
"""Least distance between two wells [m]."""

EDGE_CLEARANCE_M = 0.06
"""Least distance of a well from the edge of the rig [m]."""

NEAR_ZONE_M = 0.09
"""Greatest distance of a control well from the outline of the zone, along each axis [m]; the wells
of the paper lie 2 to 14 cm within it."""

ZONE_CLEARANCE_M = 0.07
"""Least distance of the injector from the zone [m]."""

HIDDEN = tuple(
    name
    for name in (*LIBRARY, *OUTSIDE)
    if not (
        RIG_EFFECTS[name].on_signal
        or RIG_EFFECTS[name].on_picture
        or RIG_EFFECTS[name].on_visible
        or RIG_EFFECTS[name].needs_recording
    )
)
"""Effects of rig and pumps that a scenario may hide from the twin. The photographs
have noise, drifting light and a shaking camera in every scenario."""

HIDDEN_COUNTS = (1, 0, 1, 2)
"""Numbers of hidden effects of the scenarios, in turn."""

PUMP_KINDS = ('exact', 'weak', 'exact', 'dead', 'exact', 'weak')
"""Pumps of the scenarios, in turn: as commanded, one that delivers too little, one that stops."""

OPERATOR_KINDS = ('prompt', 'late', 'prompt', 'slips', 'late', 'refuses', 'prompt')
"""Operators of the scenarios, in turn."""

PRODUCER_DELIVERY = 0.99
"""Share of its commanded rate that the producer's pump delivers (paper, section 4)."""


@dataclass(frozen=True)
class PumpFault:
    """A pump that delivers a `share` of its rate, from `start` to `end` [s]; 0: nothing."""

    well: str
    share: float
    start: float = 0.0
    end: float = math.inf


@dataclass(frozen=True)
class LoopScenario:
    """An experiment with a zone to protect, and its secrets.

    Attributes:
        name: of the scenario, such as `scenario_03`.
        rig: the nominal rig with its control section, which the twin knows.
        effects: hidden effects of the rig.
        faults: hidden faults of the pumps.
        meters: whether flow meters report the delivered rates; without them the twin knows the
            rates that the operator confirms.
        operator: the person at the pumps.
        start: when the twin takes over [s]; the safe rates hold before.
        end: end of the experiment [s].
        photo_interval: time between photographs [s].
        seed: of the photographs, their noise and the operator.
    """

    name: str
    rig: Rig
    effects: tuple[EffectDescription, ...]
    faults: tuple[PumpFault, ...]
    meters: bool
    operator: Operator
    start: float
    end: float
    photo_interval: float
    seed: int

    @property
    def describes(self) -> str:
        """Zone, wells and secrets of the scenario in words."""
        assert self.rig.control is not None
        control = self.rig.control
        parts = [
            f'{control.objective.name}, {len(control.wells)} control wells',
            *(effect.name for effect in self.effects),
            *(f'{fault.well} at {fault.share:.2f}' for fault in self.faults),
            str(self.operator),
        ]
        return ', '.join(parts)


def draw_scenario(number: int, seed: int) -> LoopScenario:
    """Return scenario `number` of the bench with `seed`.

    Kinds of zones, pumps, operators and the number of effects follow in a fixed order; everything
    else is drawn.

    Raises:
        RuntimeError: no draw gave something to control.
    """
    generator = np.random.default_rng([seed, number])
    kind = ZONE_KINDS[number % len(ZONE_KINDS)]
    minutes = float(generator.integers(50, 81))
    rig = _drawn_rig(kind, minutes * 60.0, generator)
    assert rig.control is not None
    end = minutes * 60.0
    injected = sum(well.rate_ml_h for well in rig.control.fixed.values())
    context = DrawContext(rig, ('injector', *rig.control.wells), end, injected)
    count = HIDDEN_COUNTS[number % len(HIDDEN_COUNTS)]
    names = generator.choice(HIDDEN, count, replace=False)
    return LoopScenario(
        name=f'scenario_{number + 1:02d}',
        rig=rig,
        effects=tuple(drawn(str(name), generator, context) for name in names),
        faults=_faults(PUMP_KINDS[number % len(PUMP_KINDS)], rig.control, end, generator),
        meters=bool(generator.random() < 0.5),
        operator=_operator(OPERATOR_KINDS[number % len(OPERATOR_KINDS)], generator),
        start=60.0 * float(generator.choice([0, 0, 5, 10])),
        end=end,
        photo_interval=float(generator.choice([30.0, 30.0, 60.0])),
        seed=int(generator.integers(2**31)),
    )


def demo_scenario(minutes: float = 80.0) -> LoopScenario:
    """Return the experiment of the paper's section 4, as in `./porotwin demo`."""
    control = Control(
        wells=('control1', 'control2', 'control3'),
        producer='producer',
        fixed={'injector': FixedWell(rate_ml_h=500.0, concentration=1.0)},
        disallowed_zone_m=((0.0, 0.42), (WIDTH_M, 0.30), (WIDTH_M, HEIGHT_M), (0.0, HEIGHT_M)),
    )
    return LoopScenario(
        name='demo',
        rig=_rig(PAPER_PLACES, control),
        effects=(),
        faults=(PumpFault('producer', PRODUCER_DELIVERY),),
        meters=True,
        operator=Operator(),
        start=0.0,
        end=60.0 * minutes,
        photo_interval=30.0,
        seed=7,
    )


def _rig(places: dict[str, Point], control: Control | None = None) -> Rig:
    return Rig(
        name='bench',
        width_m=WIDTH_M,
        height_m=HEIGHT_M,
        depth_m=0.010,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1.0e-3,
        density_kg_m3=998.0,
        boundaries=Boundaries(),
        wells={name: Well(x_m=x, z_m=z) for name, (x, z) in places.items()},
        control=control,
    )


# --- zones ----------------------------------------------------------------------------------------


def _slope(generator: Generator) -> Polygon:
    """Return the sand above a line, as in the paper."""
    left, right = generator.uniform(0.52, 0.80, 2) * HEIGHT_M
    return ((0.0, left), (WIDTH_M, right), (WIDTH_M, HEIGHT_M), (0.0, HEIGHT_M))


def _strip(generator: Generator) -> Polygon:
    """Return the sand right of a line that leans."""
    low, high = generator.uniform(0.40, 0.60, 2) * WIDTH_M
    return ((low, 0.0), (WIDTH_M, 0.0), (WIDTH_M, HEIGHT_M), (high, HEIGHT_M))


def _box(generator: Generator) -> Polygon:
    """Return a rectangle within the sand."""
    width, height = generator.uniform(0.18, 0.34), generator.uniform(0.14, 0.26)
    x = generator.uniform(0.05, WIDTH_M - width - 0.05)
    z = generator.uniform(0.05, HEIGHT_M - height - 0.05)
    return ((x, z), (x + width, z), (x + width, z + height), (x, z + height))


def _corner(generator: Generator) -> Polygon:
    """Return the sand in the upper right corner, beyond a diagonal."""
    x, z = generator.uniform(0.10, 0.40) * WIDTH_M, generator.uniform(0.05, 0.40) * HEIGHT_M
    return ((WIDTH_M, z), (WIDTH_M, HEIGHT_M), (x, HEIGHT_M))


def _pen(generator: Generator) -> Polygon:
    """Return a rectangle that the tracer must not leave."""
    left, right = generator.uniform(0.0, 0.08), generator.uniform(0.50, 0.68)
    low, high = generator.uniform(0.0, 0.08), generator.uniform(0.36, 0.48)
    return ((left, low), (right, low), (right, high), (left, high))


ZONES: dict[str, Callable[[Generator], Polygon]] = {
    'slope': _slope,
    'box': _box,
    'strip': _strip,
    'pen': _pen,
    'corner': _corner,
}
"""Kinds of zones; the tracer must stay within a pen, and out of the others."""

ZONE_KINDS = ('slope', 'box', 'slope', 'strip', 'slope', 'pen', 'slope', 'corner', 'slope')
"""Kinds of the scenarios, in turn: half of them are the paper's."""


# --- the rig --------------------------------------------------------------------------------------


def _drawn_rig(kind: str, duration: float, generator: Generator) -> Rig:
    """Return a rig with a zone of the `kind` where control matters within `duration` [s].

    Raises:
        RuntimeError: none of the draws is one.
    """
    for _ in range(TRIALS):
        zone = ZONES[kind](generator)
        places = _places(zone, generator)
        if generator.random() < 0.5:
            zone = tuple((WIDTH_M - x, z) for x, z in zone)
            places = {name: (WIDTH_M - x, z) for name, (x, z) in places.items()}
        if not _apart(places, zone, within=kind == 'pen'):
            continue
        rig = _rig(places, _control(kind, zone, places, generator))
        if _worth_controlling(rig, duration):
            return rig
    raise RuntimeError(f'no {kind} among {TRIALS} draws gave something to control')


def _places(zone: Polygon, generator: Generator) -> dict[str, Point]:
    """Return drawn places (x, z) [m]: the moved wells of the paper, and sometimes one more.

    The additional control well is where a laboratory would put it to protect a zone: near its edge.
    """
    places = {
        name: (x + generator.uniform(-MOVED_M, MOVED_M), z + generator.uniform(-MOVED_M, MOVED_M))
        for name, (x, z) in PAPER_PLACES.items()
    }
    if generator.random() < FOUR_WELLS:
        places['control4'] = _place_near(zone, generator)
    return {name: (round(float(x), 3), round(float(z), 3)) for name, (x, z) in places.items()}


def _place_near(zone: Polygon, generator: Generator) -> Point:
    """Return a drawn place (x, z) [m] near the part of the outline of `zone` within the rig."""
    while True:
        corner = int(generator.integers(len(zone)))
        begin, end = np.array(zone[corner]), np.array(zone[(corner + 1) % len(zone)])
        place = begin + generator.random() * (end - begin)
        x, z = place + generator.uniform(-NEAR_ZONE_M, NEAR_ZONE_M, 2)
        if (
            EDGE_CLEARANCE_M <= x <= WIDTH_M - EDGE_CLEARANCE_M
            and EDGE_CLEARANCE_M <= z <= HEIGHT_M - EDGE_CLEARANCE_M
        ):
            return float(x), float(z)


def _apart(places: dict[str, Point], zone: Polygon, *, within: bool) -> bool:
    """Return whether wells and zone leave room; the injector lies inside the zone if `within`."""
    points = np.array(list(places.values()))
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2) + np.eye(len(points))
    outline = np.array(zone)
    injector = points[:1]
    if within:
        return bool(gaps.min() >= WELL_CLEARANCE_M and inside(injector, outline)[0])
    clear = PolygonZone(outline).distance(injector)[0] >= ZONE_CLEARANCE_M
    return bool(gaps.min() >= WELL_CLEARANCE_M and clear)


def _control(kind: str, zone: Polygon, places: dict[str, Point], generator: Generator) -> Control:
    """Return drawn limits with the objective for a zone of the `kind`."""
    most = float(generator.choice([300.0, 400.0, 500.0, 600.0]))
    total = most * float(generator.choice([1.0, 1.0, 1.0, 1.5]))
    objective = ObjectiveDescription()
    if kind == 'pen':
        parameters = {'zone_m': [list(corner) for corner in zone]}
        objective = ObjectiveDescription(name='keep_in', parameters=parameters)
    return Control(
        wells=tuple(name for name in places if name.startswith('control')),
        producer='producer' if generator.random() < 0.8 else None,
        fixed={
            'injector': FixedWell(
                rate_ml_h=float(generator.choice([350.0, 450.0, 500.0])), concentration=1.0
            )
        },
        max_rate_ml_h=most,
        max_total_rate_ml_h=total,
        objective=objective,
        disallowed_zone_m=() if kind == 'pen' else zone,
    )


def _worth_controlling(rig: Rig, duration: float) -> bool:
    """Return whether control matters: tracer reaches the zone, and one well changes that."""
    return all(_is_in_range(_Trial(rig, duration, cells)) for cells in TRIAL_GRIDS)


def _is_in_range(trial: '_Trial') -> bool:
    """Return whether the tracer in the zone, and the best well alone, are in their ranges."""
    wells = range(len(trial.limits.wells))
    free = trial.volumes(None)
    if free[-1] * 1e6 < LEAST_FREE_ML:
        return False
    alone = min(float(trial.volumes(well).sum()) for well in wells)
    return ALONE_RANGE[0] <= alone / float(free.sum()) <= ALONE_RANGE[1]


class _Trial:
    """A coarse simulation of a drawn rig, with no control well or one at its maximum."""

    def __init__(self, rig: Rig, duration: float, cells: tuple[int, int]) -> None:
        self.limits = Limits.of(rig)
        grid = rig.grid(*cells)
        self._model = Model(rig, grid, preset='fast')
        self._allowed = make_objective(rig, grid).disallowed_tracer
        self._step = duration / COARSE_TIMES

    def volumes(self, well: int | None) -> FloatArray:
        """Return the tracer in the zone at all times [m^3] with one `well` at its maximum."""
        rates = np.zeros(len(self.limits.wells))
        if well is not None:
            rates[well] = self.limits.max_rate
        state, found = self._model.initial_condition(), []
        for _ in range(COARSE_TIMES):
            state = self._model.predict(state, self.limits.setpoint(rates), self._step)
            found.append(self._allowed(state))
        return np.array(found)


# --- pumps and people -----------------------------------------------------------------------------


def _faults(kind: str, control: Control, end: float, generator: Generator) -> tuple[PumpFault, ...]:
    """Return the faults of the pumps: the producer's small one, and one of the `kind`."""
    faults = []
    if control.producer is not None:
        faults.append(PumpFault(control.producer, PRODUCER_DELIVERY))
    well = str(generator.choice(control.wells))
    if kind == 'weak':
        faults.append(PumpFault(well, round(float(generator.uniform(0.75, 0.95)), 2)))
    elif kind == 'dead':
        begins = round(float(generator.uniform(0.1, 0.5)) * end / 60.0) * 60.0
        lasts = float(generator.choice([600.0, math.inf]))
        faults.append(PumpFault(well, 0.0, begins, begins + lasts))
    return tuple(faults)


def _operator(kind: str, generator: Generator) -> Operator:
    """Return a person of the `kind`."""
    if kind == 'late':
        return Operator(late=int(generator.integers(1, 4)))
    if kind == 'slips':
        return Operator(slips=0.15)
    if kind == 'refuses':
        return Operator(refuses=0.3)
    return Operator()
