"""The water balance of a rig at constant rates."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig, parse_rig
from porotwin_solver.model.water_balance import water_balance

CONDUCTIVITY = {'upper': 1e-3, 'lower': 3e-3}
"""Hydraulic conductivities [m/s] of two layers, each half of the rig."""


def layered(**others: Any) -> Rig:
    sands = {
        name: {'porosity': 0.4, 'hydraulic_conductivity_m_s': value}
        for name, value in CONDUCTIVITY.items()
    }
    rig = {
        'name': 'layers',
        'width_m': 1.0,
        'height_m': 0.4,
        'depth_m': 0.02,
        'sands': sands,
        'sand_layers': [{'sand': 'lower', 'top_m': 0.2}, {'sand': 'upper'}],
        'viscosity_pa_s': 1e-3,
        'density_kg_m3': 998.0,
        'boundaries': {'top': 'closed', 'left': 'open', 'right': 'open',
                       'heads_m': {'left': 0.41, 'right': 0.40}},
        'wells': {'a': {'x_m': 0.3, 'z_m': 0.1}, 'b': {'x_m': 0.7, 'z_m': 0.1}},
        **others,
    }  # fmt: skip
    return parse_rig(rig, Path('rig.yaml'))


def test_layers_share_the_flow_by_their_conductivity() -> None:
    """Darcy: q = K fall / width through the area of each layer."""
    rig = layered()
    found = water_balance(rig, rig.grid(50, 20), {})
    assert found is not None
    exact = {name: value * 0.01 * 0.2 * 0.02 for name, value in CONDUCTIVITY.items()}
    assert found.sands == pytest.approx(exact, rel=1e-3)
    total = sum(exact.values())
    assert found.places == pytest.approx({'left': total, 'right': -total}, rel=1e-3)


def test_clay_in_shared_cells_takes_no_flow_of_the_sand_beside_it() -> None:
    clay = {'porosity': 0.3, 'hydraulic_conductivity_m_s': 1e-9}
    sand = {'porosity': 0.4, 'hydraulic_conductivity_m_s': 1e-3}
    layers = [{'sand': 'clay', 'top_m': 0.21}, {'sand': 'sand'}]  # half a cell
    rig = layered(sands={'clay': clay, 'sand': sand}, sand_layers=layers)
    found = water_balance(rig, rig.grid(50, 20), {})
    assert found is not None
    assert found.sands['clay'] < 1e-5 * found.sands['sand']


def test_wells_and_sides_balance() -> None:
    rig, rates = layered(), {'a': WellRate(from_ml_h(500.0)), 'b': WellRate(-from_ml_h(200.0))}
    found = water_balance(rig, rig.grid(50, 20), rates)
    assert found is not None
    assert sum(found.wells.values()) + sum(found.places.values()) == pytest.approx(0.0, abs=1e-15)
    assert found.in_ml_h['wells'] == pytest.approx({'a': 500.0, 'b': -200.0})
    assert 'a +500.0, b -200.0; left' in str(found)


def test_open_water_in_the_picture_has_its_own_line() -> None:
    canal = {'corners_m': [[0.0, 0.2], [0.1, 0.2], [0.1, 0.4], [0.0, 0.4]], 'head_m': 0.41}
    sea = {'side': 'right', 'head_m': 0.40}
    rig = layered(boundaries={'top': 'closed'}, water={'canal': canal, 'sea': sea})
    found = water_balance(rig, rig.grid(50, 20), {})
    assert found is not None
    assert found.places['canal'] == pytest.approx(-found.places['sea'], rel=1e-6)


def test_water_on_parts_of_one_side_keeps_its_names() -> None:
    lower = {'side': 'left', 'to_m': 0.2, 'head_m': 0.41}
    upper = {'side': 'left', 'from_m': 0.2, 'head_m': 0.41}
    ends = {'top': 'closed', 'right': 'open', 'heads_m': {'right': 0.40}}
    rig = layered(boundaries=ends, water={'lower': lower, 'upper': upper})
    found = water_balance(rig, rig.grid(50, 20), {})
    assert found is not None
    assert found.places.keys() == {'lower', 'upper', 'right'}
    assert found.places['lower'] == pytest.approx(3.0 * found.places['upper'], rel=1e-3)


def test_a_closed_rig_with_rates_that_do_not_balance_has_none() -> None:
    rig = layered(boundaries={'top': 'closed'})
    assert water_balance(rig, rig.grid(50, 20), {'a': WellRate(1e-7)}) is None


def test_water_stands_as_described_where_no_rate_tells_its_level() -> None:
    rig = layered()
    changing = layered(levels={'left': {'points': [[10, 0.5]]}})
    found, usual = (water_balance(one, rig.grid(50, 20), {}) for one in (changing, rig))
    assert found is not None
    assert replace(found, levels={}) == usual
    assert str(found).startswith('left at 0.41 m, into'), 'it says for which level it holds'
