"""The tracer in each photograph beside that of the pumps, as a whole and at the wells."""

from pathlib import Path

import numpy as np
import pytest

from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import EffectDescription, load_rig
from porotwin_hub.estimation.tracer_watch import MAPS_IN_A_ROW, TracerWatch

RIG = load_rig(Path(__file__).parents[1] / 'config' / 'small_rig.yaml')
GRID = RIG.grid(93, 56)
PLUME = np.zeros(GRID.shape)
PLUME[20:40, 30:60] = 1.0
PLUME_ML = 1e6 * float((RIG.cell_pore_volume(GRID) * PLUME).sum())
INJECTS = {'injector': WellRate(from_ml_h(500.0), 1.0)}


def told(watch: TracerWatch, level: float, minutes: list[float]) -> list[Remark | None]:
    """Return the remark about every map of one `level`, a minute after the one before."""
    return [
        watch.at_wells(
            np.full(GRID.shape, level),
            60.0 * minute,
            [RatePeriod(60.0 * (minute - 1.0), 60.0 * minute, INJECTS)],
        )
        for minute in minutes
    ]


def test_a_well_that_stays_pale_is_told_after_some_maps() -> None:
    found = told(TracerWatch(RIG, GRID), 0.1, [*range(1, 21)])
    first = next(number for number, line in enumerate(found) if line)
    assert first >= MAPS_IN_A_ROW
    assert (found[first].code, found[first].facts['well']) == ('pale_well', 'injector')
    assert found[first].facts['share'] == pytest.approx(0.1)
    assert all(found[first:])


@pytest.mark.parametrize('level', [0.8, np.nan])
def test_a_well_full_of_tracer_or_unseen_is_not_told(level: float) -> None:
    assert not any(told(TracerWatch(RIG, GRID), level, [*range(1, 21)]))


def test_an_interruption_forgets_what_was_injected() -> None:
    watch = TracerWatch(RIG, GRID)
    told(watch, 0.1, [*range(1, 21)])
    watch.forget()
    assert not any(told(watch, 0.1, [21, 22]))


def amount(observed: np.ndarray, predicted: np.ndarray) -> Remark | None:
    """Return the remark about a photograph while no pump runs."""
    watch = TracerWatch(RIG, GRID)
    return watch.amount(observed, predicted, predicted, pumped=0.0, assumed=0.0)


def test_a_photograph_that_agrees_is_not_remarked() -> None:
    assert amount(PLUME, PLUME) is None
    assert amount(0.8 * PLUME, PLUME) is None
    assert amount(0.02 * PLUME, 0.0 * PLUME) is None


@pytest.mark.parametrize(
    ('seen', 'left', 'code'), [(0.05, 1.0, 'too_little_tracer'), (1.0, 0.0, 'too_much_tracer')]
)
def test_tracer_that_vanishes_or_appears_is_named_with_both_volumes(
    seen: float, left: float, code: str
) -> None:
    remark = amount(seen * PLUME, left * PLUME)
    assert remark is not None
    assert remark.code == code
    assert remark.facts['held_ml'] == pytest.approx(seen * PLUME_ML)
    assert remark.facts['pumped_ml'] == pytest.approx(left * PLUME_ML)


def test_cells_that_were_not_seen_do_not_count() -> None:
    assert amount(np.where(np.arange(93) < 45, np.nan, PLUME), PLUME) is None


def test_after_a_mend_the_photograph_is_weighed_with_the_mended_rig() -> None:
    """It went on with the pores of rig.yaml."""
    watch = TracerWatch(RIG, GRID)
    watch.change_rig(
        RIG.with_effects([EffectDescription(name='porosity', parameters={'factor': 0.5})])
    )
    remark = watch.amount(PLUME, 0.0 * PLUME, 0.0 * PLUME, pumped=0.0, assumed=0.0)
    assert remark is not None
    assert remark.facts['held_ml'] == pytest.approx(0.5 * PLUME_ML)
