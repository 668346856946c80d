"""Tests of odd and impossible descriptions: each is named by key, value, reason and remedy."""

import logging
from pathlib import Path
from typing import Any

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig, parse_rig
from porotwin_core.rig.oddities import remarks_about

SMALL_RIG = Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml'

WELLS: dict[str, Any] = {
    'injector': {'x_m': 0.235, 'z_m': 0.235},
    'producer': {'x_m': 0.66, 'z_m': 0.16},
}
CONTROL: dict[str, Any] = {
    'wells': ['injector'],
    'producer': 'producer',
    'disallowed_zone_m': [[0, 0.4], [0.9, 0.4], [0.9, 0.5]],
}
SMALL: dict[str, Any] = {
    'name': 'small',
    'width_m': 0.934,
    'height_m': 0.562,
    'depth_m': 0.010,
    'porosity': 0.375,
    'permeability_m2': 6.57e-10,
    'viscosity_pa_s': 1.0e-3,
    'density_kg_m3': 998.0,
    'wells': WELLS,
    'control': CONTROL,
}
BOW = [[0, 0], [0.9, 0.5], [0.9, 0], [0, 0.5]]
LESS_POROUS = {'name': 'porosity', 'parameters': {'factor': 0.9}}
CORNERS = [[20, 15], [20, 1135], [1890, 1135], [1890, 15]]


def described(change: dict[str, Any]) -> dict[str, Any]:
    """Return the small rig with changed keys; `a.b` is the key b of the section a."""
    data = {**SMALL, 'wells': dict(WELLS), 'control': dict(CONTROL)}
    for key, value in change.items():
        section, _, name = key.partition('.')
        if name:
            data[section][name] = value
        else:
            data[section] = value
    return data


def between(**heads_m: float) -> dict[str, Any]:
    """Return sides that are open where a head is given."""
    return {'top': 'closed', **dict.fromkeys(heads_m, 'open'), 'heads_m': heads_m}


def test_the_small_rig_is_not_odd() -> None:
    assert remarks_about(load_rig(SMALL_RIG)) == ()


@pytest.mark.parametrize(
    ('change', 'named'),
    [
        ({'permeability_m2': 665}, 'was this in darcy'),
        ({'depth_m': 10}, '10 mm = 0.01 m'),
        ({'width_m': 934, 'height_m': 562}, '934 mm = 0.934 m'),
        ({'viscosity_pa_s': 1.0}, 'mPa s'),
        ({'density_kg_m3': 1}, 'g/cm3'),
        ({'porosity': 37.5}, 'percent'),
        ({'wells.injector': {'x_m': 0.2, 'z_m': 0.2, 'radius_m': 0.5}}, 'radius_m is 0.5 m'),
        ({'wells.second': WELLS['injector']}, "the same place as 'injector'"),
        ({'control.max_rate_ml_h': 5e8}, 'max_rate_ml_h is 5e+08 ml/h'),
        ({'control.fixed': {}, 'control.disallowed_zone_m': [[2, 2], [3, 2], [3, 3]]}, 'covers'),
        ({'control.disallowed_zone_m': [[0, 0], [0.9, 0.5], [0.9, 0], [0, 0.5]]}, 'crosses itself'),
        ({'control.objective': {'name': 'keep_in', 'zone_m': [[2, 2], [3, 2], [3, 3]]}}, 'covers'),
        ({'camera': {'corners_px': CORNERS[::-1]}}, 'mirror image'),
        ({'camera': {'corners_px': [CORNERS[i] for i in (0, 3, 2, 1)]}}, 'mirror image'),
        ({'camera': {'corners_px': [CORNERS[i] for i in (0, 2, 1, 3)]}}, 'without a dent'),
        ({'camera': {'corners_px': CORNERS, 'colour_checker_px': CORNERS[::-1]}}, 'checker_px'),
        ({'camera': {'corners_px': CORNERS[:3]}}, 'too few values'),
        ({'depth_m': '10 mm'}, 'write the number alone'),
        ({'density_kg_m3': '9_98.0'}, 'write the number alone'),
        ({'depth_m': '0,01'}, 'decimal point'),
        ({'depth_m': True}, 'write a number'),
        ({'depth_m': float('inf')}, 'finite'),
        ({'width_mm': 934}, "write 'width_m'; 1 mm is 0.001 m"),
        ({'name': ''}, 'name'),
        (
            {'wells.wall': {'x_m': 0.0, 'z_m': 0.2}},
            'on the edge of the rig of 0.934 x 0.562 m; x_m must be above 0 and below',
        ),
        ({'wells.top': {'x_m': 0.3, 'z_m': 0.562}}, 'below 0.562; move it into the sand'),
        (
            {'wells.far': {'x_m': 23.5, 'z_m': 23.5}},
            'was this in mm, (0.0235, 0.0235) m or in cm, (0.235, 0.235) m?',
        ),
        ({'wells.far': {'x_m': 235, 'z_m': 235}}, 'was this in mm, (0.235, 0.235) m?'),
        ({'wells.turned': {'x_m': 0.2, 'z_m': 0.562}}, 'exchanged? (0.562, 0.2) m lies inside'),
        ({'wells.turned': {'x_m': 0.2, 'z_m': 0.9}}, 'exchanged? (0.9, 0.2) m lies inside'),
        (
            {'width_m': 934, 'control.disallowed_zone_m': [], 'control.zone': {'file': 'no.png'}},
            'was this in mm',
        ),
        (
            {'control.fixed': {'injector': {'rate_ml_h': 5, 'concentration': 50}}},
            '50 percent = 0.5',
        ),
        ({'wells.list': [0.2, 0.3]}, 'write a section'),
        ({'wells.comma': {'x_m': 0, '39': None, 'z_m': 0.2}}, 'a decimal comma'),
        ({'name': 5}, 'put numbers and dates in quotes'),
        ({'control.wells': 'injector'}, 'write a list'),
        (
            {
                'control.fixed': {},
                'control.producer': None,
                'boundaries': {'left': 'open'},
                'control.max_producer_rate_ml_h': 9,
            },
            'there is no producer',
        ),
        (
            {
                'control.wells': [],
                'control.fixed': {'injector': {'rate_ml_h': '1 l/d'}},
                'control.max_producer_rate_ml_h': 40,
            },
            'the fixed wells alone inject 41.6667 ml/h',
        ),
        ({'control.max_rate_ml_h': '6 litre per day'}, 'with a unit, such as 6 l/d'),
        ({'boundaries': {'top': 'open', 'heads_m': {'top': '1 ft'}}}, 'with a unit, such as 48 cm'),
        *(
            (
                {
                    'control.wells': [],
                    'control.end_min': end,
                    'control.fixed': {'injector': {'rate_ml_h': 5, **cycles}},
                },
                named,
            )
            for end, cycles, named in (
                (60, {'on_min': 7}, 'cycles need on_min and a longer every_min'),
                (60, {'on_min': 7, 'every_min': 5}, 'a longer every_min'),
                (60, {'on_min': 7, 'every_min': 9, 'pauses_min': [[1, 2]]}, 'keep one'),
                (60, {'from_min': 7}, 'from_min begins the cycles'),
                (None, {'on_min': 7, 'every_min': 9}, 'cycles need the end of the experiment'),
                (60, {'on_min': 1e-6, 'every_min': 1e-5}, 'take at most 10000'),
                (60, {'on_min': 360, 'every_min': 720}, 'lasts longer than end_min 60'),
                (60, {'on_min': 1e-309, 'every_min': 1e-308}, 'take at most 10000'),
            )
        ),
        ({'control.rate_step_ml_h': 1e-320}, 'no pump has such a step'),
        ({'control.min_rate_ml_h': 410, 'control.rate_step_ml_h': 300}, 'no multiple of rate_step'),
        (
            {'control.min_rate_ml_h': 9, 'control.max_total_rate_ml_h': 8},
            'max_total_rate_ml_h 8 is below 9',
        ),
        (
            {'control.rate_step_ml_h': 9, 'control.max_total_rate_ml_h': 8},
            'max_total_rate_ml_h 8 is below 9 ml/h',
        ),
        (
            {
                'control.min_rate_ml_h': 11,
                'control.rate_step_ml_h': 10,
                'control.max_change_ml_h': 15,
            },
            'max_change_ml_h 15 is below 20 ml/h',
        ),
        (
            {'control.fixed': {'injector': {'rate_ml_h': 500.0, 'pauses_min': [[20, 10]]}}},
            'a pause from 20 to 10 min: its end must be later',
        ),
        (
            {
                'control.fixed': {
                    'injector': {'rate_ml_h': 500.0, 'pauses_min': [[30, 40], [10, 31]]}
                }
            },
            'a pause from 30 to 40 min overlaps the one from 10 to 31 min',
        ),
        (
            {
                'control.end_min': 60,
                'control.fixed': {'injector': {'rate_ml_h': 500.0, 'pauses_min': [[50, 70]]}},
            },
            'fixed.injector.pauses_min: a pause from 50 to 70 min ends after end_min 60',
        ),
        (
            {'control.fixed': {'injector': {'rate_ml_h': -500.0, 'concentration': 1.0}}},
            'takes out 500 ml/h, but has the concentration 1 of injected water',
        ),
        (
            {'control.fixed': {'injector': {'rate_ml_h': -500.0}}},
            'take out 500 ml/h more than they inject, so that producer would have to inject',
        ),
        (
            {
                'control.fixed': {
                    'injector': {'rate_ml_h': 500.0, 'pauses_min': [[20, 30]]},
                    'control3': {'rate_ml_h': -100.0},
                },
                'control.wells': ['control1', 'control2'],
            },
            'take out 100 ml/h more than they inject in the pause at 20 min',
        ),
        *(
            (
                {'control.fixed': {'injector': {'rate_ml_h': 500.0, 'pauses_min': [pause]}}},
                'control.fixed.injector.pauses_min.0',
            )
            for pause in ([float('nan'), 5], [5, float('nan')], [-5, 5], [5], 5)
        ),
        (
            {'effects': [{'name': 'leak', 'parameters': {'x': 0.2, 'z': 0.2, 'rate': 1e7}}]},
            'effects: leak: rate is 1e+07 ml/h: the pores of the whole rig hold',
        ),
        (
            {'boundaries': between(left=50.0, right=0.5)},
            'the water falls by 49.5 m over the 0.934 m',
        ),
        ({'boundaries': {**between(left=0.5, right=0.4), 'top': 'open'}}, 'unless you write top'),
        ({'boundaries': between(left=0.5) | {'heads_m': {'32': 0.5}}}, 'a decimal comma?'),
        ({'boundaries': between(left=0.5) | {'heads_m': {'Left': 0.5}}}, "write 'top', 'bottom'"),
        ({'control.end_min': 1e12}, 'end_min = 1000000000000.0: no experiment is longer'),
        (
            {'control.objective': {'name': 'sweep', 'zones_m': [BOW]}},
            'control.objective.zones_m.0',
        ),
        (
            {
                'control.objective': {
                    'name': 'sum',
                    'parts': [{'name': 'keep_in', 'zone_m': BOW}],
                }
            },
            'control.objective.parts.0.zone_m',
        ),
    ],
)
def test_an_impossible_value_is_refused_on_one_line(change: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_rig(described(change), Path('rig.yaml'))
    assert named in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('change', 'named'),
    [
        ({'porosity': 0.15}, 'porosity is 0.15: sand lies between 0.2 and 0.6'),
        ({'permeability_m2': 3e-8}, 'permeability_m2'),
        ({'depth_m': 0.3}, 'the model is flat'),
        ({'wells.INJECTOR': {'x_m': 0.5, 'z_m': 0.3}}, 'capital letters'),
        (
            {
                'wells.w\u00e9': {'x_m': 0.5, 'z_m': 0.3},
                'wells.we\u0301': {'x_m': 0.6, 'z_m': 0.3},
            },
            'or coding only',
        ),
        ({'wells.injector ': {'x_m': 0.5, 'z_m': 0.3}}, 'look the same'),
        ({'wells.\uff49njector': {'x_m': 0.5, 'z_m': 0.3}}, 'look the same'),
        ({'width_m': 16.0}, 'was this in cm or inches or feet?'),
        ({'wells.wall': {'x_m': 0.001, 'z_m': 0.2}}, 'reaches into the wall 0.001 m away'),
        ({'wells.near': {'x_m': 0.24, 'z_m': 0.235}}, "overlaps 'injector'"),
        ({'wells.wide': {'x_m': 0.4, 'z_m': 0.4, 'radius_m': 0.06}}, 'a tenth of the rig'),
        ({'control.max_total_rate_ml_h': 100}, 'below the sum of 100 ml/h'),
        ({'control.max_rate_ml_h': 5.6e-8}, 'was this in m3/s?'),
        ({'control.disallowed_zone_m': [[0, 0.4], [1.9, 0.4], [0.9, 0.5]]}, 'reaches beyond'),
        ({'camera': {'corners_px': [CORNERS[i] for i in (2, 3, 0, 1)]}}, 'upside down'),
        ({'camera': {'corners_px': [CORNERS[i] for i in (1, 2, 3, 0)]}}, 'on its side'),
        ({'depth_m': {'points': [[0, 0, 0.01], [934, 0, 0.01]]}}, '(934, 0) m: it lies outside'),
        ({'depth_m': {'points': [[0, 0, 0.01], [0, 0, 0.02]]}}, 'it has two depths'),
        (
            {'depth_m': {'points': [[0, 0, 0.01], [0.5, 0, 0.011], [0.9, 0, 0.1]]}},
            'depth_m.points is 0.1 m at (0.9, 0) m: most points are about 0.011 m deep',
        ),
        ({'control.fuzziness_m': 10}, 'counts as the zone'),
        ({'control.change_cost_ml_min': 1e9}, 'the twin would never order'),
        ({'wells': {}, 'control': None}, 'no water can be pumped'),
        ({'boundaries': between(right=0.5)}, 'give the head of a second open side'),
        ({'boundaries': between(left=0.5, right=0.5)}, 'only between open sides with different'),
        ({'boundaries': between(left=2.0, right=0.5)}, 'are they in cm?'),
        ({'boundaries': between(left=0.5, top=0.6)}, 'meet in a corner'),
        (
            {
                'boundaries': between(left=0.45, right=0.47),
                'control.wells': [],
                'control.fixed': {'injector': {'rate_ml_h': 5, 'concentration': 1}},
            },
            'were the two heads exchanged?',
        ),
        (
            {'effects': [LESS_POROUS, LESS_POROUS]},
            'effects.2 is porosity: it repeats an effect above',
        ),
        (
            {'effects': [{'name': 'rate', 'parameters': {'well': 'injector', 'factor': 92}}]},
            'write 0.92 if 92 % is meant',
        ),
    ],
)
def test_an_odd_value_is_used_with_a_warning(
    change: dict[str, Any], named: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger='porotwin'):
        parse_rig(described(change), Path('rig.yaml'))
    assert any(named in record.getMessage() for record in caplog.records), caplog.text
    assert all('rig.yaml: ' in record.getMessage() for record in caplog.records)


def test_fixed_wells_that_alternate_inject_as_one() -> None:
    fixed = {
        name: {'rate_ml_h': 400.0, 'on_min': 7, 'every_min': 14, 'from_min': begin}
        for name, begin in (('first', 0), ('second', 7))
    }
    places = {'wells.first': {'x_m': 0.4, 'z_m': 0.4}, 'wells.second': {'x_m': 0.5, 'z_m': 0.4}}
    data = described({**places, 'control.fixed': fixed, 'control.end_min': 63})
    assert remarks_about(parse_rig(data, Path('rig.yaml'))) == ()


def test_fixed_wells_may_outdo_the_control() -> None:
    fixed = {'producer2': {'rate_ml_h': 800.0, 'concentration': 1.0}}
    place = {'x_m': 0.4, 'z_m': 0.4}
    data = described({'wells.producer2': place, 'control.fixed': fixed})
    (remark,) = remarks_about(parse_rig(data, Path('rig.yaml')))
    assert 'inject 800 ml/h, more than the control wells may' in str(remark)


@pytest.mark.parametrize(
    ('clay_m2', 'well_z_m', 'odd'), [(5e-13, 0.25, True), (2e-12, 0.25, False), (5e-13, 0.3, False)]
)
def test_a_well_in_sand_that_hardly_conducts_is_named(
    clay_m2: float, well_z_m: float, odd: bool
) -> None:
    data = described({'wells.tight': {'x_m': 0.4, 'z_m': well_z_m}})
    del data['porosity'], data['permeability_m2']
    data['sands'] = {
        'coarse': {'porosity': 0.4, 'permeability_m2': 1e-9},
        'clay': {'porosity': 0.4, 'permeability_m2': clay_m2},
    }
    data['sand_layers'] = [
        {'sand': 'coarse', 'top_m': 0.24},
        {'sand': 'clay', 'top_m': 0.30},
        {'sand': 'coarse'},
    ]
    remarks = [str(remark) for remark in remarks_about(parse_rig(data, Path('rig.yaml')))]
    found = [one for one in remarks if 'hardly any water' in one]
    assert len(found) == odd
    assert not odd or "wells.tight is (0.4, 0.25) m: the sand 'clay' there has 5e-13" in found[0]


@pytest.mark.parametrize(
    ('conductivities', 'count'), [((1e-3, 1e-8), 0), ((1e-8, 1e-8), 2), ((1e-3, 1e-4), 0)]
)
def test_a_barrier_beside_sand_is_no_mistake(conductivities: tuple[float, ...], count: int) -> None:
    data = {
        key: value for key, value in SMALL.items() if key not in ('porosity', 'permeability_m2')
    }
    data['sands'] = {
        f'sand{number}': {'porosity': 0.4, 'hydraulic_conductivity_m_s': value}
        for number, value in enumerate(conductivities)
    }
    data['sand_layers'] = [{'sand': 'sand1', 'top_m': 0.1}, {'sand': 'sand0'}]
    remarks = remarks_about(parse_rig(data, Path('rig.yaml')))
    found = [one for one in remarks if 'hydraulic_conductivity' in str(one)]
    assert len(found) == count


def test_water_that_moves_by_itself_needs_no_wells() -> None:
    water = {'left': {'side': 'left', 'head_m': 0.5}, 'right': {'side': 'right', 'head_m': 0.4}}
    data = {**SMALL, 'wells': {}, 'boundaries': {'top': 'closed'}, 'water': water}
    for key in ('control', 'camera'):
        data.pop(key, None)
    assert [
        one for one in remarks_about(parse_rig(data, Path('rig.yaml'))) if one.key == 'wells'
    ] == []
