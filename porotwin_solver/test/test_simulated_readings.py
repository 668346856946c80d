"""Simulated readings of the outflow and of pressures, against Darcy's law and hydrostatics."""

import math
from typing import Any

import numpy as np
import pytest
from test_water_balance import layered

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY, from_ml_h
from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading, Port
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.model.simulated_readings import simulated_readings

CLOSED = {'boundaries': {'top': 'closed'}}
SAND = {
    'sands': {'sand': {'porosity': 0.4, 'hydraulic_conductivity_m_s': 1e-3}},
    'sand_layers': [{'sand': 'sand'}],
}

RESTING = Schedule(())


def pressure(port: Port, against: Port | None = None, time: float = 0.0) -> GaugeReading:
    return GaugeReading(time, GaugeKind.PRESSURE, 0.0, 1.0, port=port, against=against)


def outflow(place: str, time: float) -> GaugeReading:
    return GaugeReading(time, GaugeKind.OUTFLOW, 0.0, 1.0, place)


def pumped(rate_ml_h: float) -> Schedule:
    there = WellRate(from_ml_h(rate_ml_h), 1.0)
    return Schedule.from_rates([(0.0, {'a': there, 'b': WellRate(-there.rate)})])


def shown(
    rig: Rig, *readings: GaugeReading, schedule: Schedule = RESTING, **given: Any
) -> list[float]:
    given = {'start': 0.0, **given}
    return simulated_readings(rig, schedule, readings, grid=rig.grid(50, 20), **given).tolist()


def test_the_pressure_falls_evenly_between_two_levels() -> None:
    rig = layered()
    places = (0.1, 0.33, 0.5, 0.9)
    found = shown(rig, *(pressure((x, 0.25)) for x in places))
    exact = [998.0 * GRAVITY * 0.01 * (1.0 - x) for x in places]
    assert found == pytest.approx(exact, rel=1e-6)
    (between,) = shown(rig, pressure((0.2, 0.1), (0.6, 0.3)))
    assert between == pytest.approx(998.0 * GRAVITY * 0.01 * 0.4, rel=1e-6)


def test_the_sides_have_passed_what_darcy_says() -> None:
    rig = layered(**SAND)
    exact = 1e-3 * 0.01 * 0.4 * 0.02 * 600.0
    found = shown(rig, outflow('right', 600.0), outflow('left', 600.0), outflow('top', 600.0))
    assert found == pytest.approx([exact, -exact, 0.0], rel=1e-6, abs=1e-15)


def test_a_weak_pump_shows_in_the_outflow_and_not_a_denser_sand() -> None:
    rig = layered(**CLOSED, **SAND)
    weak = EffectDescription(name='rate', parameters={'well': 'a', 'factor': 0.8})
    dense = EffectDescription(name='porosity', parameters={'factor': 1.25})
    asked = outflow('b', 1800.0), outflow('a', 1800.0)
    for effects, ml in (((), 60.0), ((weak,), 48.0), ((dense,), 60.0)):
        found = shown(rig, *asked, schedule=pumped(120.0), effects=effects)
        assert found == pytest.approx([ml * 1e-6, -ml * 1e-6], rel=1e-9)


def test_a_pump_that_weakens_later_delivers_in_full_before() -> None:
    rig = layered(**CLOSED, **SAND)
    weak = EffectDescription(name='rate', parameters={'well': 'a', 'factor': 0.8, 'since': 900.0})
    asked = outflow('b', 900.0), outflow('b', 1800.0)
    found = shown(rig, *asked, schedule=pumped(120.0), effects=(weak,))
    assert found == pytest.approx([30e-6, 54e-6], rel=1e-9)


def test_a_deeper_rig_has_less_pressure_between_two_ports() -> None:
    rig = layered(**CLOSED, **SAND)
    deep = EffectDescription(name='depth', parameters={'factor_centre': 1.25})
    asked = pressure((0.4, 0.1), (0.6, 0.1))
    (plain,) = shown(rig, asked, schedule=pumped(120.0))
    (less,) = shown(rig, asked, schedule=pumped(120.0), effects=(deep,))

    assert plain / 1.25 < less < 0.9 * plain


def test_resting_stock_weighs_and_viscous_stock_resists() -> None:
    dense = EffectDescription(name='buoyancy', parameters={'density_difference': 10.0})
    full = np.ones((20, 50))
    rig = layered(**CLOSED, **SAND)
    (found,) = shown(rig, pressure((0.5, 0.1), (0.5, 0.3)), initial=full, effects=(dense,))
    assert found == pytest.approx(10.0 * GRAVITY * 0.2, rel=1e-6)
    thick = EffectDescription(name='viscosity', parameters={'viscosity_ratio': 1.5})
    asked = pressure((0.4, 0.1), (0.6, 0.1))
    thin, resists = (
        shown(layered(**CLOSED, **SAND), asked, schedule=pumped(120.0), initial=full, effects=e)[0]
        for e in ((), (thick,))
    )
    assert resists == pytest.approx(1.5 * thin, rel=1e-4)


def test_the_outflow_has_the_concentration_of_the_sand_beside_it() -> None:
    rig = layered(**SAND)
    half = np.full((20, 50), 0.5)
    asked = [
        GaugeReading(60.0, GaugeKind.CONCENTRATION, 0.0, 1.0, place)
        for place in ('right', 'b', 'top')
    ]
    found = shown(rig, *asked, initial=half)
    assert found == pytest.approx([0.5, 0.5, 0.0], rel=1e-2)


def test_a_reading_from_before_the_model_starts_is_unknown() -> None:
    rig = layered()
    early, late = shown(rig, outflow('right', 5.0), outflow('right', 20.0), start=10.0)
    assert math.isnan(early) and late > 0.0


@pytest.mark.parametrize(
    ('reading', 'word'),
    [
        (outflow('drain', 60.0), 'drain'),
        (pressure((1.5, 0.1), (0.5, 0.1)), 'outside'),
        (pressure((0.5, 0.1)), 'second port'),
        (GaugeReading(0.0, GaugeKind.CONCENTRATION, 0.0, 1.0, 'drain'), 'drain'),
    ],
)
def test_a_place_that_the_rig_lacks_is_named(reading: GaugeReading, word: str) -> None:
    with pytest.raises(InputError, match=word):
        shown(layered(**CLOSED, **SAND), reading)
