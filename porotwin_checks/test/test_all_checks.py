"""The runner of the checks: the known data decide about the checks."""

import ast
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_checks import checks
from porotwin_checks.all_checks import (
    CHECKS,
    OF_MAPS,
    OF_PHOTOGRAPHS,
    OF_RIG,
    OF_TABLES,
    remarks_about,
)
from porotwin_checks.known import Known
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate

RIG = box_rig(**{'in': (0.1, 0.1)})


def test_a_check_is_found_because_its_file_lies_in_the_folder() -> None:
    files = {path.stem for path in Path(checks.__file__).parent.glob('*.py')} - {'__init__'}
    assert set(CHECKS) == files
    assert {*OF_MAPS, *OF_RIG, *OF_TABLES, *OF_PHOTOGRAPHS} == files


@pytest.mark.parametrize('name', sorted(CHECKS))
def test_a_check_needs_what_can_be_known(name: str) -> None:
    assert set(CHECKS[name].needs) <= {field.name for field in fields(Known)} | {'rates'}


@pytest.mark.parametrize('name', sorted(CHECKS))
def test_an_explaining_code_is_one_that_some_check_tells(name: str) -> None:
    folder = Path(checks.__file__).parent
    texts = {
        node.value
        for path in folder.glob('*.py')
        if path.stem != name
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
        if isinstance(node, ast.Constant)
    }
    assert set(CHECKS[name].explained_by) <= texts | set(CHECKS)


def test_a_rig_alone_has_nothing_to_ask() -> None:
    assert remarks_about(Known(rig=RIG)) == ()


def test_maps_that_nothing_calibrated_are_not_compared_with_the_pumps() -> None:
    """`image` asked the pumps about calibrated maps only, `diagnose` about all: `image` was right.

    Without a calibration a value says how dark the sand is, and no volume follows from it.
    """
    rates = Schedule((ScheduleRow(0.0, 'in', WellRate(1e-9, 1.0)),))
    maps = [np.zeros((20, 30)), np.tile(np.linspace(0.0, 1.0, 30), (20, 1))]
    known = Known(rig=RIG, pumped=rates, times=[0.0, 60.0], maps=maps)
    assert remarks_about(known, OF_MAPS) == ()
    scaled = replace(known, scaled_maps=maps)
    assert [remark.code for remark in remarks_about(scaled, OF_MAPS)] == ['too_much_tracer']
    late = replace(
        scaled, commanded=rates, photos=[SimpleNamespace(time=30.0, name='a', role='baseline')]
    )
    assert remarks_about(late, OF_MAPS) == ()  # the baseline explains it, and was told before
