"""Draws the scenarios of the closed loop: zones, wells, limits, hidden effects, faults, operators.

A scenario follows from its number and the seed alone. The places of wells and zone are drawn until
the nominal model says that control matters as in the paper's experiment: without control much
tracer reaches the zone; the best plan known offline keeps most of it out; it needs several wells;
and no constant rates come near it. No controller has a part in this choice.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from lab.loop.bench_loop_dose import Plan, ScenarioDose, simple_plans
from lab.loop.bench_loop_optimum import PIECE_S, SWITCHES, improved
from lab.loop.bench_loop_scenarios import HEIGHT_M, PAPER_PLACES, WIDTH_M, Point, plain_rig
from porotwin_cli.running.drawn_effects import LIBRARY, OUTSIDE, drawn
from porotwin_cli.running.loop_operator import Operator
from porotwin_cli.running.loop_scenario import PRODUCER_DELIVERY, LoopScenario, PumpFault
from porotwin_core.geometry.polygons import inside
from porotwin_core.geometry.zone_shapes import PolygonZone
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.rig import Control, FixedWell, ObjectiveDescription, Polygon
from porotwin_rig.effects import EFFECTS as RIG_EFFECTS

MOVED_M = 0.06
"""Greatest distance of a drawn well from its place in the paper, along each axis [m]."""

FOUR_WELLS = 0.3
"""Probability of one control well more."""

TRIAL_CELL_M = 0.02
"""Width of the cells on which a drawn scenario is tried [m]: a simulation takes milliseconds."""

LEAST_FREE_ML_MIN = 150.0
"""Least dose without control [ml min]: the tracer is in the zone for a good part of the time."""

LEAST_BEST_ML_MIN = 10.0
"""Least dose of the best plan [ml min]: below, ratios of doses compare errors of the maps."""

BEST_RANGE = (0.02, 0.25)
"""Dose of the best plan, relative to no control; 0.026 in the paper's experiment. Below, the zone
is far from the plume, and any controller would do. Above, the wells are in wrong places, and a
laboratory would move them."""

MOST_HELD = 0.5
"""Greatest dose of constant rates that the search begins with, relative to no control."""

LEAST_CONSTANT = 1.3
"""Least dose of the best constant rates, relative to the best plan. It is 1.7 in the paper's
experiment. At 1 the first idea of any controller would do for the whole experiment."""

LEAST_SHARE = 0.1
"""Share of the water of the best plan that the second well injects, at least."""

TRIALS = 4000
"""Most draws of the places of one scenario."""

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

INJECTION_KINDS = ('steady', 'pause', 'steady', 'steady', 'pulses')
"""How the tracer is injected, in turn: all the time, with one pause, or in pulses."""

PAUSE_S = 600.0
"""Length of the one pause of the injection [s]."""

PULSE_S, BETWEEN_PULSES_S = 900.0, 300.0
"""Length of a pulse of tracer, and of the pause after it [s]."""

OPERATOR_KINDS = ('prompt', 'late', 'prompt', 'slips', 'late', 'refuses', 'prompt')
"""Operators of the scenarios, in turn."""


def draw_scenario(
    number: int, seed: int, *, accept: Callable[[LoopScenario], bool] | None = None
) -> LoopScenario:
    """Return scenario `number` of the bench with `seed`.

    Kinds of zones, pumps, operators and the number of effects follow in a fixed order; everything
    else is drawn.

    Args:
        number: of the scenario, from 0 on.
        seed: of the bench.
        accept: tells whether a scenario without secrets is taken; None: `is_worth_controlling`.

    Raises:
        RuntimeError: no draw gave something to control.
    """
    generator = np.random.default_rng([seed, number])
    injection = INJECTION_KINDS[number % len(INJECTION_KINDS)]
    nominal = LoopScenario(
        name=f'scenario_{number + 1:02d}',
        rig=plain_rig(PAPER_PLACES, None),
        effects=(),
        faults=(),
        meters=bool(injection != 'steady' or generator.random() < 0.5),
        operator=_operator(OPERATOR_KINDS[number % len(OPERATOR_KINDS)], generator),
        start=60.0 * float(generator.choice([0, 0, 5, 10])),
        end=60.0 * float(generator.integers(50, 81)),
        photo_interval=float(generator.choice([30.0, 60.0, 60.0, 60.0])),
        seed=int(generator.integers(2**31)),
    )
    pauses = _pauses(injection, nominal.end, generator)
    kind = ZONE_KINDS[number % len(ZONE_KINDS)]
    nominal = replace(nominal, faults=pauses)
    scenario = _with_drawn_rig(nominal, kind, generator, accept or is_worth_controlling)
    return _with_secrets(scenario, number, generator)


def _with_secrets(scenario: LoopScenario, number: int, generator: Generator) -> LoopScenario:
    """Return scenario `number` with its hidden effects and faults of the pumps."""
    rig = scenario.rig
    assert rig.control is not None
    injected = sum(well.rate_ml_h for well in rig.control.fixed.values())
    context = DrawContext(rig, ('injector', *rig.control.wells), scenario.end, injected)
    count = HIDDEN_COUNTS[number % len(HIDDEN_COUNTS)]
    names = generator.choice(HIDDEN, count, replace=False)
    pump = PUMP_KINDS[number % len(PUMP_KINDS)]
    return replace(
        scenario,
        effects=tuple(drawn(str(name), generator, context) for name in names),
        faults=scenario.faults + _faults(pump, rig.control, scenario.end, generator),
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
}
"""Kinds of zones; the tracer must stay within a pen, and out of the others."""

ZONE_KINDS = ('slope', 'box', 'slope', 'strip', 'pen', 'slope', 'box', 'slope', 'pen')
"""Kinds of the scenarios, in turn: half of them are the paper's."""


# --- the rig --------------------------------------------------------------------------------------


def _with_drawn_rig(
    nominal: LoopScenario,
    kind: str,
    generator: Generator,
    accept: Callable[[LoopScenario], bool],
) -> LoopScenario:
    """Return `nominal` with a drawn rig, with a zone of the `kind`, that is accepted.

    Raises:
        RuntimeError: none of the draws is one.
    """
    for _ in range(TRIALS):
        zone = ZONES[kind](generator)
        places = _places(kind, zone, generator)
        if generator.random() < 0.5:
            zone = tuple((WIDTH_M - x, z) for x, z in zone)
            places = {name: (WIDTH_M - x, z) for name, (x, z) in places.items()}
        control = _control(kind, zone, places, generator)
        if not _apart(places, zone, within=kind == 'pen'):
            continue
        scenario = replace(nominal, rig=plain_rig(places, control))
        if accept(scenario):
            return scenario
    raise RuntimeError(f'no {kind} among {TRIALS} draws gave something to control')


def _places(kind: str, zone: Polygon, generator: Generator) -> dict[str, Point]:
    """Return drawn places (x, z) [m]: those of the paper, moved, and sometimes one more well.

    Another zone than the paper's has control wells where a laboratory would put them to protect it:
    near its edge. So has a fourth one.
    """
    places = {
        name: (x + generator.uniform(-MOVED_M, MOVED_M), z + generator.uniform(-MOVED_M, MOVED_M))
        for name, (x, z) in PAPER_PLACES.items()
    }
    near = ['control4'] if generator.random() < FOUR_WELLS else []
    if kind != 'slope':
        near += [name for name in places if name.startswith('control')]
    places |= {name: _place_near(zone, generator) for name in near}
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


def is_worth_controlling(scenario: LoopScenario) -> bool:
    """Return whether control matters in a scenario without secrets.

    Tracer reaches the zone without control. The best plan found offline keeps most of it out, uses
    several wells, and leaves a dose that can be measured. No constant rates come near it.
    """
    dose = ScenarioDose(scenario, cell=TRIAL_CELL_M)
    constant, switched = simple_plans(dose.limits, dose.duration, SWITCHES)
    free = dose.dose(constant[0])
    if free < LEAST_FREE_ML_MIN:
        return False
    held = min(constant[1:], key=dose.dose)
    least = max(LEAST_BEST_ML_MIN, BEST_RANGE[0] * free)
    if not least <= dose.dose(held) <= MOST_HELD * free:
        return False
    first = min((plan for plan in switched if _goes_on(plan, held)), key=dose.dose, default=held)
    best = improved(dose, min(held, first, key=dose.dose), piece=PIECE_S)
    if not least <= dose.dose(best) <= BEST_RANGE[1] * free or not _uses_wells(dose, best):
        return False
    held = improved(dose, held, piece=dose.duration)
    return dose.dose(held) >= LEAST_CONSTANT * dose.dose(best)


def _goes_on(plan: Plan, held: Plan) -> bool:
    """Return whether `plan` begins with the rates of `held`."""
    return bool((plan.rates[0] == held.rates[0]).all())


def _uses_wells(dose: ScenarioDose, plan: Plan) -> bool:
    """Return whether a second well injects its share of the water of a plan."""
    lengths = np.diff(np.append(plan.starts, dose.duration))
    water = np.sort(lengths @ plan.rates)
    return bool(water[-2] >= LEAST_SHARE * water.sum())


# --- pumps and people -----------------------------------------------------------------------------


def _pauses(kind: str, end: float, generator: Generator) -> tuple[PumpFault, ...]:
    """Return when the injector stands still."""
    if kind == 'pause':
        begin = 60.0 * round(float(generator.uniform(0.3, 0.6)) * end / 60.0)
        return (PumpFault('injector', 0.0, begin, begin + PAUSE_S),)
    if kind == 'pulses':
        begins = np.arange(PULSE_S, end, PULSE_S + BETWEEN_PULSES_S)
        return tuple(
            PumpFault('injector', 0.0, float(begin), float(begin) + BETWEEN_PULSES_S)
            for begin in begins
        )
    return ()


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
