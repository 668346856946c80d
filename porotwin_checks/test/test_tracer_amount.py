"""Maps whose tracer the pumps cannot have left are told, but not tracer that leaves."""

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_checks.checks.tracer_amount import CHECK, amount_remark
from porotwin_checks.known import Known, stock_in_map
from porotwin_core.basis.units import ML
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import EffectDescription
from porotwin_solver.coefficients.quantities import tracer_volume
from porotwin_solver.effects import described_physics

RIG = box_rig(**{'in': (0.3, 0.2), 'out': (0.55, 0.2)})
"""1920 ml of pores."""
TIMES = [100.0 * number for number in range(1, 11)]
INJECTED = [0.4 * min(number, 5) / 5 for number in range(1, 11)]
"""Share of a middle block of a quarter of the rig: 38 ml more in each map, 192 ml at the end."""
PUMPED = Schedule(
    (
        ScheduleRow(0.0, 'in', WellRate(0.384e-6, 1.0)),
        ScheduleRow(0.0, 'out', WellRate(-0.384e-6)),
        ScheduleRow(500.0, 'in', WellRate(0.0)),
        ScheduleRow(500.0, 'out', WellRate(0.0)),
    )
)
LATE = Schedule((ScheduleRow(100.0, 'in', WellRate(1e-6, 0.5)),))
"""Half stock, 1 ml/s from 100 s on."""


def found(maps, times=TIMES, rates=PUMPED, rig=RIG):
    """Return the remarks about maps (nz, nx)."""
    known = Known(rig=rig, pumped=rates, times=times, maps=maps, scaled_maps=maps)
    return list(CHECK.find(known)) if all(map(known.has, CHECK.needs)) else []


def told(factors, *, at_exit=0.0, background=0.0, rig=RIG):
    """Return the remarks on maps with `factors` of the injected tracer in the middle of the rig."""
    maps = []
    for level, factor in zip(INJECTED, factors, strict=True):
        values = np.full((40, 60), background)
        values[10:30, 15:45] += level * factor
        values[18:22, 53:57] += at_exit
        maps.append(values)
    return found(maps, rig=rig)


@pytest.mark.parametrize('factor', [0.9, 1.0, 1.1])
def test_tracer_that_keeps_to_the_pumps_is_not_told(factor: float) -> None:
    assert told([factor] * 10) == []
    assert told([factor] * 10, background=0.005) == []


def test_tracer_that_described_pumps_and_bottles_lack_is_not_told() -> None:
    """After a diagnosis was applied, `check` told the missing tracer once more."""
    for name in ('rate', 'stock_strength'):
        weak = EffectDescription(name=name, parameters={'well': 'in', 'factor': 0.6})
        described = RIG.model_copy(update={'effects': (weak,)})
        assert [one.code for one in told([0.6] * 10)] == ['lost_tracer']
        assert told([0.6] * 10, rig=described) == []
        assert [one.code for one in told([1.0] * 10, rig=described)] == ['too_much_tracer']


def test_a_gain_and_a_loss_are_told_with_their_times() -> None:
    (gain,) = told([1.0] * 5 + [1.0, 1.05, 1.1, 1.2, 1.3])
    assert (gain.code, gain.facts['end_s']) == ('gained_tracer', 1000.0)
    assert gain.facts['ml'] == pytest.approx(57.6)
    (loss,) = told([1.0] * 5 + [1.0, 0.95, 0.9, 0.8, 0.7])
    assert (loss.code, loss.facts['end_s']) == ('lost_tracer', 1000.0)
    assert loss.facts['ml'] == pytest.approx(57.6)


def test_tracer_near_a_producer_may_leave() -> None:
    assert told([1.0] * 5 + [1.0, 0.95, 0.9, 0.8, 0.7], at_exit=0.2) == []


def test_one_wrong_photograph_is_no_drift() -> None:
    assert told([1.0] * 6 + [1.4] + [1.0] * 3) == []


def test_hidden_parts_and_few_maps_are_not_judged() -> None:
    assert found([np.full((40, 60), np.nan)] * 10) == []
    assert found([], []) == []


@pytest.mark.parametrize(
    ('share', 'time', 'code'),
    [
        (0.05, 292.0, ''),  # 96 ml are seen, 96 ml were injected
        (0.10, 292.0, 'too_much_tracer'),
        (0.005, 100.0, ''),  # the noise of clean sand before the injection
        (0.05, 50.0, 'too_much_tracer'),  # tracer before the injection
    ],
)
def test_too_much_tracer_is_told(share: float, time: float, code: str) -> None:
    maps = [np.zeros((20, 30)), np.full((20, 30), share)]
    maps[1][:, 1] += 0.06  # a plume is seen, whatever the mean
    assert [one.code for one in found(maps, [0.0, time], LATE)] == ([code] if code else [])


def test_the_remark_has_both_volumes_and_unknown_cells_hold_nothing() -> None:
    values = np.full((20, 30), np.nan)
    values[:10] = 0.4
    (remark,) = found([np.zeros((20, 30)), values], [0.0, 292.0], LATE)
    assert remark.facts['held_ml'] == pytest.approx(384.0)
    assert remark.facts['pumped_ml'] == pytest.approx(96.0)


def test_unknown_rates_contradict_nothing() -> None:
    assert found([np.ones((20, 30))], [0.0], Schedule()) == []


@pytest.mark.parametrize(
    ('held', 'pumped', 'code'),
    [
        (60.0, 60.0, ''),
        (45.0, 60.0, ''),
        (15.0, 0.0, ''),
        (3.0, 60.0, 'too_little_tracer'),
        (60.0, 0.0, 'too_much_tracer'),
    ],
)
def test_a_predicted_volume_is_compared_both_ways(held: float, pumped: float, code: str) -> None:
    rates = Schedule(
        (ScheduleRow(0.0, 'dye', WellRate(1e-7, 1.0)), ScheduleRow(0.0, 'water', WellRate(1e-7)))
    )
    told = amount_remark(held / ML, pumped / ML, RIG.pore_volume, 'the photograph', rates)
    assert ('' if told is None else told.code) == code
    assert told is None or told.facts['wells'] == 'dye'


def test_volumes_that_clean_sand_shows_are_no_tracer() -> None:
    """The running twin told from 3 ml on, recordings from 1 % of the pores on.

    Clean maps of the 22 recordings of another simulator show up to 0.43 % of the pores: 8 ml of
    1968. The twin cried at their noise; 1 % is right.
    """
    noise = 0.0043 * RIG.pore_volume
    assert noise > 3.0 / ML
    assert amount_remark(noise, 0.0, RIG.pore_volume, 'the photograph', Schedule()) is None
    assert (
        amount_remark(3.0 * noise, 0.0, RIG.pore_volume, 'the photograph', Schedule()) is not None
    )


def test_a_map_holds_the_stock_that_the_solver_counts() -> None:
    """The checks took the pores of rig.yaml, without its effects: 25 ml were 20 ml by the solver.

    Sorbed tracer was injected too, so that both count it.
    """
    values = np.random.default_rng(3).random((20, 30))
    changes = [
        EffectDescription(name='porosity', parameters={'factor': 0.8}),
        EffectDescription(name='retardation', parameters={'retardation_factor': 1.5}),
    ]
    rig = RIG.with_effects(changes)
    counted = tracer_volume(described_physics(rig, rig.grid(30, 20)), values)
    assert stock_in_map(values, rig) == pytest.approx(counted)
    assert counted == pytest.approx(1.2 * stock_in_map(values, RIG))
