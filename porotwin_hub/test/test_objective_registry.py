"""Tests of the registry of objectives: found by name, refused with one line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import parse_rig
from porotwin_hub.objectives.objective_registry import OBJECTIVES, make_objective

TRIANGLE = [[0.1, 0.1], [0.9, 0.1], [0.5, 0.9]]


def test_every_module_of_objectives_is_found() -> None:
    folder = Path(__file__).resolve().parents[1] / 'porotwin_hub' / 'objectives'
    modules = {path.stem for path in folder.glob('*.py')} - {
        *('__init__', 'objective', 'objective_registry', 'zones')
    }
    assert set(OBJECTIVES) == modules
    assert {'keep_out', 'keep_in'} <= modules
    assert all(kind.summary for kind in OBJECTIVES.values())


@pytest.mark.parametrize(
    ('control', 'complaint'),
    [
        (
            {'objective': {'name': 'keep_in', 'zone_m': [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]]}},
            'zone_m is 5 to 6 m in x, 5 to 6 m in z: it covers nothing of the rig',
        ),
        (
            {'disallowed_zone_m': [[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]]},
            'it is too thin to cover a place of the rig',
        ),
        (
            {'objective': {'name': 'keep_in', 'zone_m': [[-1, -1], [2, -1], [2, 2], [-1, 2]]}},
            'an empty rig and a rig full of tracer cost the same',
        ),
        (
            {
                'disallowed_zone_m': TRIANGLE,
                'objective': {'name': 'keep_out', 'disallowed_zone_m': TRIANGLE},
            },
            'stands in control and in its objective',
        ),
        (
            {'objective': 'keep_dry'},
            f"objective 'keep_dry': unknown; choose from {', '.join(OBJECTIVES)}, sum",
        ),
        (
            {'objective': {'name': 'sum', 'parts': [{'name': 'keep_dry'}]}},
            "objective 'keep_dry': unknown",
        ),
        ({'objective': {'name': 'sum', 'parts': []}}, "objective 'sum': parts"),
        (
            {'objective': {'name': 'sum', 'parts': [{'name': 'sum', 'parts': []}]}},
            'stands inside a sum; write all parts side by side',
        ),
        (
            {'objective': {'name': 'sum', 'parts': [{'name': 'least_water'}]}},
            'parts = least_water: tracer costs nothing',
        ),
        (
            {
                'end_min': 30.0,
                'objective': {'name': 'reach', 'zone_m': TRIANGLE, 'at_min': 60.0},
            },
            'at_min = 60 lies after control.end_min = 30',
        ),
        *(
            (
                {
                    'disallowed_zone_m': TRIANGLE,
                    'objective': {'name': 'sum', 'parts': [{'name': 'keep_out', 'weight': weight}]},
                },
                'weight = ',
            )
            for weight in (0.0, -1.0, float('inf'), float('nan'))
        ),
        (
            {'objective': 'keep_in'},
            "objective 'keep_in': 'zone_m' is missing: corners (x, z) of the zone [m]",
        ),
        (
            {'objective': {'name': 'keep_in', 'zone_m': TRIANGLE, 'fuzzines_m': 0.1}},
            "objective 'keep_in': unknown key 'fuzzines_m'; correct or remove it",
        ),
        (
            {'objective': {'name': 'keep_in', 'zone_m': TRIANGLE[:2]}},
            'needs at least three corners',
        ),
        (
            {'objective': {'name': 'keep_in', 'zone_m': TRIANGLE, 'fuzziness_m': -1.0}},
            "objective 'keep_in': fuzziness_m = -1.0",
        ),
        (
            {},
            "objective 'keep_out': 'disallowed_zone_m' is missing: corners (x, z) of the zone",
        ),
    ],
)
def test_a_wrong_objective_is_refused_with_one_line(
    unit_rig: dict[str, Any], control: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(InputError) as caught:
        rig = parse_rig({**unit_rig, 'control': {'wells': ['a'], **control}}, Path('rig.yaml'))
        make_objective(rig, rig.grid(10, 10))
    assert complaint in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_rig_without_control_has_no_objective(unit_rig: dict[str, Any]) -> None:
    rig = parse_rig(unit_rig, Path('rig.yaml'))
    with pytest.raises(InputError, match='no control section'):
        make_objective(rig, rig.grid(10, 10))


def test_keys_of_the_control_section_are_parameters_of_the_objective(
    unit_rig: dict[str, Any],
) -> None:
    def cost(control: dict[str, Any]) -> float:
        rig = parse_rig({**unit_rig, 'control': {'wells': ['a'], **control}}, Path('rig.yaml'))
        grid = rig.grid(40, 40)
        return make_objective(rig, grid)(np.ones(grid.shape))

    in_section = cost({'disallowed_zone_m': TRIANGLE, 'fuzziness_m': 0.07})
    parameters = {'name': 'keep_out', 'disallowed_zone_m': TRIANGLE, 'fuzziness_m': 0.07}
    assert in_section == cost({'objective': parameters})
    assert in_section != cost({'disallowed_zone_m': TRIANGLE, 'fuzziness_m': 0.08})
    keep_in = {'name': 'keep_in', 'zone_m': TRIANGLE}
    assert cost({'objective': keep_in, 'fuzziness_m': 0.07}) == cost(
        {'objective': {**keep_in, 'fuzziness_m': 0.07}}
    )


@pytest.mark.parametrize(
    'objective',
    [
        {'name': 'keep_out'},
        {'name': 'keep_in'},
        {'name': 'sweep'},
        {'name': 'hold_front'},
        {'name': 'reach', 'at_min': 20.0},
        {'name': 'sum', 'parts': [{'name': 'keep_in'}, {'name': 'least_water'}]},
    ],
)
def test_the_zone_of_a_picture_is_that_of_its_corners(
    unit_rig: dict[str, Any], objective: dict[str, Any], tmp_path: Path
) -> None:
    left_half = [[0.0, 0.0], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0]]
    keys = {'sweep': 'zones_m', 'hold_front': 'tracer_m', 'keep_out': 'disallowed_zone_m'}

    def with_corners(part: dict[str, Any]) -> dict[str, Any]:
        if part['name'] == 'least_water':
            return part
        if part['name'] == 'sum':
            return {**part, 'parts': [with_corners(one) for one in part['parts']]}
        key = keys.get(part['name'], 'zone_m')
        return {**part, key: [left_half] if key == 'zones_m' else left_half}

    def made(objective: dict[str, Any], **control: Any) -> Any:
        section = {'wells': ['a'], 'objective': objective, 'fuzziness_m': 0.0, **control}
        rig = parse_rig({**unit_rig, 'control': section}, tmp_path / 'rig.yaml')
        return make_objective(rig, rig.grid(20, 20))

    pixels = np.zeros((100, 100), dtype=np.uint8)
    pixels[:, :50] = 255
    Image.fromarray(pixels).save(tmp_path / 'zone.png')
    plume = np.random.default_rng(5).random((20, 20))
    pictured, cornered = made(objective, zone={'file': 'zone.png'}), made(with_corners(objective))
    assert pictured(plume) == pytest.approx(cornered(plume))
    assert pictured.disallowed_tracer(plume) == pytest.approx(cornered.disallowed_tracer(plume))


def test_a_picture_that_no_objective_takes_is_refused(
    unit_rig: dict[str, Any], tmp_path: Path
) -> None:
    objective = {'name': 'keep_in', 'zone_m': TRIANGLE}
    pixels = np.zeros((50, 50), dtype=np.uint8)
    pixels[:, :20] = 255
    Image.fromarray(pixels).save(tmp_path / 'zone.png')
    section = {'wells': ['a'], 'objective': objective, 'zone': {'file': 'zone.png'}}
    rig = parse_rig({**unit_rig, 'control': section}, tmp_path / 'rig.yaml')
    with pytest.raises(InputError, match=r"control\.zone: objective 'keep_in' takes no zone"):
        make_objective(rig, rig.grid(10, 10))
