"""Tests of the rates that a plan announces."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.announced_rates import uncontrolled_rates, with_plan
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate, net_rate
from porotwin_core.rig import Control, Rig, load_rig
from porotwin_core.rig.control_section import FixedWell

SMALL = load_rig(Path(__file__).resolve().parents[2] / 'rigs' / 'small' / 'rig.yaml')
STOCK = WellRate(from_ml_h(500.0), 1.0)
REST = WellRate()


def control_of(rig: Rig) -> Control:
    assert rig.control is not None
    return rig.control


def paused(*pauses_min: tuple[float, float], end_min: float | None = None) -> Rig:
    control = control_of(SMALL).with_pauses({'injector': pauses_min}, end_min)
    return SMALL.model_copy(update={'control': control})


def plan(*rows: tuple[float, str, WellRate]) -> Schedule:
    return Schedule(tuple(ScheduleRow(*row) for row in rows))


def test_the_rates_without_control_have_the_pauses_of_the_rig() -> None:
    rates = uncontrolled_rates(paused((7.0, 14.0), (21.0, 28.0)))
    assert rates.injected_stock(0.0, 1680.0) == pytest.approx(STOCK.rate * 840.0)
    assert all(abs(net_rate(rates.at(time))) < 1e-20 for time in (0.0, 420.0, 840.0, 1260.0))
    assert uncontrolled_rates(SMALL).injected_stock(0.0, 1680.0) == pytest.approx(
        STOCK.rate * 1680.0
    )


def test_a_plan_adds_its_pauses_and_its_end_to_the_rig() -> None:
    planned = with_plan(
        paused((1.0, 2.0)),
        plan((0.0, 'injector', STOCK), (300.0, 'injector', REST), (600.0, 'injector', STOCK),
             (900.0, 'injector', REST)),
        'rates.csv',
    )  # fmt: skip
    assert control_of(planned).fixed['injector'].pauses_min == ((1.0, 2.0), (5.0, 10.0))
    assert control_of(planned).end_min == 15.0
    assert uncontrolled_rates(planned).injected_stock(0.0, 900.0) == pytest.approx(
        STOCK.rate * 540.0
    )


def test_a_well_without_a_row_never_pumps_and_one_that_stops_rests_until_the_end() -> None:
    rig = paused(end_min=60.0)
    never = with_plan(rig, plan((0.0, 'control1', REST)), 'rates.csv')
    assert control_of(never).fixed['injector'].pauses_min == ((0.0, 60.0),)
    stopped = with_plan(
        rig, plan((0.0, 'injector', STOCK), (1800.0, 'injector', REST)), 'rates.csv'
    )
    assert control_of(stopped).fixed['injector'].pauses_min == ((30.0, 60.0),)


@pytest.mark.parametrize(
    ('well', 'rate', 'fault'),
    [
        ('injector', WellRate(from_ml_h(300.0), 1.0), 'setpoints hold it at the 500 ml/h'),
        ('injector', WellRate(from_ml_h(500.0), 0.0), 'concentration 0'),
    ],
)
def test_a_plan_that_no_setpoint_can_hold_is_refused(well: str, rate: WellRate, fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        with_plan(SMALL, plan((0.0, well, rate)), 'rates.csv')


def test_an_earlier_end_cuts_the_pauses() -> None:
    cut = control_of(paused((7.0, 14.0), (21.0, 28.0), end_min=63.0)).until(25.0)
    assert cut.fixed['injector'].pauses_min == ((7.0, 14.0), (21.0, 25.0))
    assert control_of(paused((30.0, 40.0))).until(25.0).fixed['injector'].pauses_min == ()
    Control.model_validate(cut.model_dump(exclude_unset=True))


def test_a_producer_limits_the_control_wells_by_the_injectors_that_run_together() -> None:
    """Two injectors of 500 ml/h alternate: the producer takes 1500 ml/h, never 2000."""
    two = {
        'injector': {'rate_ml_h': '12 l/d', 'pauses_min': [[0, 7]]},
        'other': {'rate_ml_h': 500, 'pauses_min': [[7, 14]]},
    }
    told = {'wells': ['control1'], 'producer': 'producer', 'fixed': two, 'end_min': 14,
            'max_total_rate_ml_h': 1000}  # fmt: skip
    free = Control.model_validate(told)
    assert (free.most_fixed_ml_h, free.most_total_ml_h) == (500.0, 1000.0)
    limited = Control.model_validate({**told, 'max_producer_rate_ml_h': '0.8 l/h'})
    assert limited.most_total_ml_h == pytest.approx(300.0)


def test_cycles_are_pauses_until_the_end() -> None:
    """The canal tank: two injectors that alternate every 7 min."""
    cycle = {'rate_ml_h': 500, 'concentration': 1, 'on_min': 7, 'every_min': 14}
    fixed = {'injector': cycle, 'other': {**cycle, 'from_min': 7}}
    told = {'wells': [], 'producer': 'producer', 'fixed': fixed, 'end_min': 63}
    control = Control.model_validate(told)
    assert control.fixed['injector'].pauses_min == ((7, 14), (21, 28), (35, 42), (49, 56))
    assert control.fixed['other'].pauses_min == ((0, 7), (14, 21), (28, 35), (42, 49), (56, 63))
    assert Control.model_validate(control.model_dump(exclude_defaults=True)) == control


@pytest.mark.parametrize('every', [0.3, 0.7, 1.1, 1.3, 9.7])
def test_a_last_rest_reaches_the_end_in_spite_of_round_off(every: float) -> None:
    well = FixedWell(rate_ml_h=500.0, on_min=every / 2, every_min=every)
    for cycles in range(1, 30):
        end = round(cycles * every, 1)
        assert well.with_cycles_as_pauses(end).pauses_min[-1][1] == end
