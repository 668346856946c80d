"""Water at the sand in `rig.yaml`: values read, refused, odd, and sent."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from rclpy.serialization import deserialize_message, serialize_message

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig, parse_rig, write_rig
from porotwin_core.rig.oddities import remarks_about
from porotwin_core.rig.rig_file import load_rig
from porotwin_core.ros import conversions

PLAIN = {
    'name': 'tank',
    'width_m': 0.65,
    'height_m': 0.51,
    'depth_m': 0.02,
    'porosity': 0.38,
    'permeability_m2': 5e-10,
    'viscosity_pa_s': 1e-3,
    'density_kg_m3': 998.0,
    'boundaries': {'top': 'closed'},
    'wells': {'ink': {'x_m': 0.3, 'z_m': 0.3}},
}
CORNERS = [[0.0, 0.4], [0.04, 0.4], [0.04, 0.45], [0.0, 0.45]]
WATER: dict[str, Any] = {
    'canal': {'corners_m': CORNERS, 'head_m': 0.452},
    'sea': {'side': 'right', 'to_m': 0.4, 'head_m': 0.457, 'concentration': 1.0},
    'rain': {'side': 'top', 'from_m': 0.2, 'to_m': 0.4, 'rate_ml_h': 300.0},
    'lake': {'side': 'left', 'rate_ml_h': -20.0, 'concentration': 1.0, 'diffuses': True},
}


def rig_with(water: dict[str, Any], **others: Any) -> Rig:
    return parse_rig({**PLAIN, **others, 'water': water}, Path('rig.yaml'))


def test_water_is_written_and_read_again(tmp_path: Path) -> None:
    rig = rig_with(WATER)
    write_rig(rig, tmp_path / 'rig.yaml')
    assert load_rig(tmp_path) == rig
    assert not rig.closed
    assert rig.is_driven


def test_water_survives_the_wire() -> None:
    rig = rig_with(WATER)
    message = conversions.rig_to_msg(rig)
    again = conversions.rig_from_msg(deserialize_message(serialize_message(message), type(message)))
    assert again == rig
    assert again.physics_fingerprint == rig.physics_fingerprint


def test_the_fingerprint_of_a_rig_without_water_is_the_old_one_and_water_changes_it() -> None:
    plain = parse_rig(PLAIN, Path('rig.yaml'))
    assert plain.physics_fingerprint == OLD_FINGERPRINT
    higher = {**WATER, 'canal': {**WATER['canal'], 'head_m': 0.453}}
    found = {rig_with(water).physics_fingerprint for water in (WATER, higher)}
    assert len({plain.physics_fingerprint, *found}) == 3


OLD_FINGERPRINT = '3bb408e3cd70'


@pytest.mark.parametrize(
    ('water', 'others', 'complaint'),
    [
        ({'a': {'head_m': 0.4}}, {}, 'give either side or corners_m'),
        ({'a': {'side': 'left', 'corners_m': CORNERS, 'head_m': 1}}, {}, 'give either side or'),
        ({'a': {'side': 'left'}}, {}, 'either head_m or rate_ml_h'),
        ({'a': {'corners_m': CORNERS, 'rate_ml_h': 3.0}}, {}, 'corners_m takes head_m only'),
        ({'a': {'side': 'left', 'from_m': 0.3, 'to_m': 0.2, 'head_m': 1}}, {}, 'less than to_m'),
        ({'a': {'side': 'left', 'to_m': 0.6, 'head_m': 0.4}}, {}, 'left side is 0.51 m long'),
        (
            {'a': {'side': 'left', 'from_m': 0.51, 'to_m': 0.51 + 1e-13, 'rate_ml_h': 9}},
            {},
            'left side is 0.51 m long',
        ),
        ({'a': {'side': 'top', 'rate_ml_h': 9}}, {}, 'water cannot leave'),
        (
            {'a': {'side': 'left', 'head_m': 0.4}, 'b': {'side': 'left', 'head_m': 0.5}},
            {},
            "overlaps 'a'",
        ),
        ({'a': {'side': 'left', 'head_m': 0.4}}, {'boundaries': {}}, 'open without a head'),
        (
            {'a': {'side': 'left', 'head_m': 0.4}},
            {'boundaries': {'top': 'closed', 'left': 'open', 'heads_m': {'left': 0.5}}},
            'write left: closed',
        ),
        (
            {'a': {'corners_m': [[0.2, 0.2], [0.4, 0.2], [0.4, 0.4], [0.2, 0.4]], 'head_m': 0.4}},
            {},
            'lies in the open water',
        ),
    ],
)
def test_impossible_water_is_refused(water, others, complaint) -> None:
    with pytest.raises(InputError, match=complaint):
        rig_with(water, **others)


def test_a_level_in_another_unit_is_odd_or_refused() -> None:
    water = {'a': {'side': 'left', 'head_m': 0.9}, 'b': {'side': 'right', 'head_m': 0.51}}
    (remark,) = remarks_about(rig_with(water))
    assert remark.key == 'water.a.head_m'
    with pytest.raises(InputError, match='is it in cm'):
        rig_with({**water, 'a': {'side': 'left', 'head_m': 45.2}})


HIGH = {'corners_m': [[0.61, 0.4], [0.65, 0.4], [0.65, 0.48], [0.61, 0.48]], 'head_m': 0.455}
OPEN = {'boundaries': {'top': 'closed', 'left': 'open', 'heads_m': {'left': 0.6}}}
SEA, TABLE = WATER['sea'], {'water_table': {'fringe_m': 0.02}}


@pytest.mark.parametrize(
    ('water', 'others', 'odd'),
    [
        (WATER, {}, []),
        ({'low': {**WATER['canal'], 'head_m': 0.44}, 'sea': SEA}, {}, []),
        ({'low': {**WATER['canal'], 'head_m': 0.446}, 'high': HIGH}, {}, []),
        ({'low': {**WATER['canal'], 'head_m': 0.476}, 'high': HIGH}, {}, ['water.low.head_m']),
        ({'below': {**SEA, 'from_m': 0.1, 'head_m': 0.05}}, {}, ['water.below.head_m']),
        ({'above': {'side': 'top', 'head_m': 0.5}}, {}, ['water.above.head_m']),
        ({'partly': {**SEA, 'head_m': 0.3}}, {}, ['water.partly.head_m']),
        ({'partly': {**SEA, 'head_m': 0.3}}, TABLE, []),
        ({'sea': {**SEA, 'head_m': 0.2}}, TABLE, ['wells.ink']),
        ({'sea': SEA}, {'water_table': {'fringe_m': 50.0}}, ['water_table.fringe_m']),
        (WATER, {'levels': {'canal': {'points': [[5, 0.39], [9, 0.45]]}}}, ['levels.canal']),
        (WATER, {'levels': {'sea': {'points': [[5, 0.41]]}}}, []),
        (WATER, {'levels': {'canal': {'points': [[5, 0.52]]}}}, ['levels.canal']),
        ({'sea': {**SEA, 'head_m': 0.52}}, {}, []),  # in a reservoir beside the closed rig
        ({'sea': {**SEA, 'head_m': 0.52}}, TABLE, ['water.sea.head_m']),
        ({'sea': {**SEA, 'head_m': '45 cm'}}, OPEN, []),  # a head beside other water drives water
        ({'sea': {**SEA, 'head_m': 0.6}}, OPEN, ['boundaries.heads_m']),
        (
            {'sea': {**SEA, 'head_m': 0.6}},
            {**OPEN, 'levels': {'sea': {'points': [[10, 0.61]]}}},
            [],
        ),
        (
            {'rain': WATER['rain']},
            {
                **TABLE,
                'boundaries': {'top': 'closed', 'left': 'open', 'heads_m': {'left': -0.2}},
            },
            ['boundaries.heads_m', 'boundaries.heads_m.left', 'wells.ink'],
        ),
    ],
)
def test_water_that_misses_its_place_is_odd(water, others, odd) -> None:
    assert [one.key for one in remarks_about(rig_with(water, **others))] == odd


def test_maps_show_no_canals_and_no_dry_sand_unless_it_rains() -> None:
    water = {name: WATER[name] for name in ('canal', 'sea')}
    table = {'water_table': {'fringe_m': 0.02}}
    rig = rig_with(water, **table)
    grid = rig.grid(65, 51)
    wet = rig.wet_sand(grid)
    row, column = (grid.z > 0.40) & (grid.z < 0.45), grid.x < 0.04
    assert not wet[np.ix_(row, column)].any(), 'the canal'
    assert not wet[grid.z > 0.477].any(), 'above the highest level plus the fringe'
    assert wet[grid.z < 0.40].all()
    held = rig.cell_pore_volume(grid)[wet].sum()
    assert rig.pore_volume == pytest.approx(held, rel=0.02), 'nor does it hold their water'
    assert rig_with(WATER, **table).wet_sand(grid)[-1].all(), 'rain may raise the table'


def test_an_unknown_rate_is_an_interval_and_no_physics() -> None:
    def tank(prior: list[float]) -> Rig:
        ink = {'x_m': 0.3, 'z_m': 0.3, 'rate_prior_ml_h': prior}
        return rig_with(WATER, wells={'ink': ink})

    median, deviation = tank([50.0, 200.0]).wells['ink'].believed_rate_ml_h or (0.0, 0.0)
    assert median == pytest.approx(100.0)
    assert median * np.exp(1.645 * deviation) == pytest.approx(200.0, rel=1e-3)
    assert tank([50.0, 200.0]).physics_fingerprint == rig_with(WATER).physics_fingerprint
    with pytest.raises(InputError, match='first must be less'):
        tank([200.0, 50.0])
