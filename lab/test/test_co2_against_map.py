"""The real photograph of CO2 against the official map, read in place."""

from pathlib import Path

import numpy as np
import pytest

from lab.photographs.co2_against_map import BOXES, DATA, Co2Photographs, overlaps
from porotwin_core.basis.errors import InputError
from porotwin_imaging.phases.colour_change import REASONS, SEEN
from porotwin_imaging.phases.phase_colours import UNKNOWN, WATER
from porotwin_imaging.phases.phase_segmentation import PhaseMap


@pytest.fixture(scope='module')
def case() -> Co2Photographs:
    if not DATA.is_dir():
        pytest.skip(f'the photographs of {DATA.name} are not in {DATA.parent}')
    return Co2Photographs.read(Path(DATA))


@pytest.fixture(scope='module')
def found(case) -> PhaseMap:
    return case.phases()


def test_co2_and_gas_overlap_with_the_official_map(case, found) -> None:
    measured = overlaps(found.phase, case.official)
    assert measured['CO2'] > 0.86
    assert measured['gas'] > 0.76


def test_boxes_find_the_same(case) -> None:
    measured = overlaps(case.phases(BOXES).phase, case.official)
    assert measured['CO2'] > 0.86
    assert measured['gas'] > 0.76


def test_every_seen_cell_has_a_phase_and_each_other_one_a_reason(case, found) -> None:
    known = found.phase != UNKNOWN
    assert known[case.official != WATER].all()
    assert ((found.confidence[known] > 1 / 3) & (found.confidence[known] <= 1.0)).all()
    np.testing.assert_array_equal(known, found.reason == SEEN)
    assert (found.reason < len(REASONS)).all()


def test_nothing_is_found_where_nothing_is(case) -> None:
    with pytest.raises(InputError, match='nothing has changed'):
        case.phases(state=case.baseline)
