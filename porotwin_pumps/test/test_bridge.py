"""Tests of the bridge: rates, expiry, faults and measurements, with pumps of a few lines."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig, load_rig
from porotwin_pumps.bridge import RETRY_PERIOD_S, PumpBridge
from porotwin_pumps.protocols.pump_protocol import PumpError, PumpSilent

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
SAFE_ML_H = {'injector': 500.0, 'producer': -500.0, 'control1': 0.0, 'control2': 0.0,
             'control3': 0.0}  # fmt: skip


class FakePump:
    """A pump that does as it is told unless `broken`; it delivers `share` of its rate."""

    def __init__(self) -> None:
        self.rate_ml_h = 0.0
        self.volume = 0.0
        self.broken = False
        self.stopped = False
        self.share = 1.0
        self.settings = 0

    def _answer(self) -> None:
        if self.broken:
            raise PumpSilent('it does not answer')
        if self.stopped:
            raise PumpError('alarm: it stalled')

    def set_rate(self, rate_ml_h: float) -> None:
        self._answer()
        self.rate_ml_h = rate_ml_h
        self.settings += 1

    def check(self) -> None:
        self._answer()

    def volume_ml(self) -> float:
        self._answer()
        return self.volume

    def run(self, seconds: float) -> None:
        self.volume += self.share * self.rate_ml_h * seconds / 3600.0


class Bench:
    """A bridge with fake pumps and a clock."""

    def __init__(self, rig: Rig = RIG) -> None:
        self.now = 1000.0
        self.pumps = {well: FakePump() for well in RIG.wells}

        def opener(well: str):
            def open_pump() -> FakePump:
                self.pumps[well].check()
                return self.pumps[well]

            return open_pump

        self.bridge = PumpBridge(
            rig,
            {well: opener(well) for well in RIG.wells},
            max_rates_ml_h=dict.fromkeys(RIG.wells, 1500.0),
            now=self.now,
        )

    def pass_time(self, seconds: float) -> None:
        self.now += seconds
        for pump in self.pumps.values():
            pump.run(seconds)

    def command(self, control1: float = 100.0, validity: float = 90.0) -> None:
        self.bridge.command(setpoint(control1), until=self.now + validity, now=self.now)

    def ml_h(self) -> dict[str, float]:
        return {well: round(pump.rate_ml_h, 6) for well, pump in self.pumps.items()}


def setpoint(control1: float) -> dict[str, WellRate]:
    ml_h = {**SAFE_ML_H, 'control1': control1, 'producer': -500.0 - control1}
    return {
        well: WellRate(from_ml_h(rate), 1.0 if well == 'injector' else 0.0)
        for well, rate in ml_h.items()
    }


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_safe_rates_hold_before_the_first_setpoint(bench: Bench) -> None:
    assert bench.ml_h() == SAFE_ML_H


def test_a_setpoint_is_pumped_until_it_ends(bench: Bench) -> None:
    bench.command(100.0)
    assert bench.ml_h() == {**SAFE_ML_H, 'control1': 100.0, 'producer': -600.0}
    bench.pass_time(89.0)
    assert bench.bridge.tick(bench.now) is None
    bench.pass_time(2.0)
    assert 'has ended and none followed' in str(bench.bridge.tick(bench.now))
    assert bench.ml_h() == SAFE_ML_H
    assert bench.bridge.tick(bench.now) is None


def test_a_pump_whose_rate_stays_is_not_touched(bench: Bench) -> None:
    before = {well: pump.settings for well, pump in bench.pumps.items()}
    bench.command(100.0)
    bench.command(100.0)
    changed = {w for w, pump in bench.pumps.items() if pump.settings > before[w]}
    assert changed == {'control1', 'producer'}
    assert bench.pumps['control1'].settings == before['control1'] + 1


def test_a_setpoint_beyond_a_pump_changes_nothing(bench: Bench) -> None:
    bench.command(100.0)
    for wrong in (
        {**setpoint(100.0), 'control1': WellRate(from_ml_h(1501.0))},
        {**setpoint(100.0), 'nowhere': WellRate(from_ml_h(1.0))},
    ):
        with pytest.raises(InputError):
            bench.bridge.command(wrong, until=bench.now + 90.0, now=bench.now)
    assert bench.ml_h()['control1'] == 100.0


def test_a_pump_that_fails_sends_the_others_to_their_safe_rates(bench: Bench) -> None:
    bench.command(100.0)
    bench.pumps['control2'].broken = True
    line = bench.bridge.tick(bench.now)
    assert line is not None
    assert line.startswith("the pump of 'control2': it does not answer; the other pumps run")
    assert bench.ml_h() == SAFE_ML_H
    with pytest.raises(PumpError, match="the pump of 'control2'"):
        bench.command(100.0)
    assert bench.ml_h() == SAFE_ML_H


@pytest.mark.parametrize('method', ['check', 'volume_ml', 'set_rate'])
def test_a_mistake_in_a_protocol_counts_as_a_fault_of_its_pump(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    def wrong(*_: float) -> float:
        raise ValueError('no number:\nE?')

    bench.command(100.0)
    bench.pass_time(5.0)
    monkeypatch.setattr(bench.pumps['control1'], method, wrong)
    bench.bridge.measure(bench.now)
    bench.bridge.tick(bench.now)
    with pytest.raises(PumpError, match="the pump of 'control1': ValueError: no number: E"):
        bench.command(200.0)
    assert bench.ml_h()['producer'] == SAFE_ML_H['producer']


@pytest.mark.parametrize('next_is_a_setpoint', [True, False])
def test_a_fault_that_a_measurement_finds_sends_the_others_to_their_safe_rates(
    bench: Bench, next_is_a_setpoint: bool
) -> None:
    for _ in range(2):  # also when the pump fails again
        bench.command(100.0)
        bench.pass_time(5.0)
        bench.pumps['control2'].broken = True
        bench.bridge.measure(bench.now)
        if next_is_a_setpoint:
            with pytest.raises(PumpError, match="the pump of 'control2'"):
                bench.command(200.0)
        else:
            assert "the pump of 'control2'" in str(bench.bridge.tick(bench.now))
        assert bench.ml_h() == SAFE_ML_H
        assert bench.bridge.tick(bench.now) is None
        bench.pumps['control2'].broken = False


def test_a_pump_that_works_again_beside_another_fault_keeps_no_refused_setpoint(
    bench: Bench,
) -> None:
    bench.command(100.0)
    for well in ('control1', 'control2'):
        bench.pumps[well].broken = True
    bench.bridge.tick(bench.now)
    bench.pumps['control1'].broken = False
    with pytest.raises(PumpError, match="the pump of 'control2'"):
        bench.command(300.0)
    assert bench.ml_h() == SAFE_ML_H


def test_a_pump_that_works_again_beside_another_fault_is_told(bench: Bench) -> None:
    for well in ('control1', 'control2'):
        bench.pumps[well].broken = True
    bench.bridge.tick(bench.now)
    bench.pumps['control1'].broken = False
    bench.pass_time(RETRY_PERIOD_S)
    line = str(bench.bridge.tick(bench.now))
    assert line.startswith("the pump of 'control2'")
    assert 'control1' not in line


def test_nothing_is_put_in_while_the_producer_fails(bench: Bench) -> None:
    bench.command(100.0)
    bench.pumps['producer'].broken = True
    assert "'producer'" in str(bench.bridge.tick(bench.now))
    assert all(rate == 0.0 for well, rate in bench.ml_h().items() if well != 'producer')
    bench.pumps['producer'].broken = False
    bench.pass_time(RETRY_PERIOD_S)
    assert bench.bridge.tick(bench.now) == 'all pumps work again, at the safe rates'
    assert bench.ml_h() == SAFE_ML_H
    assert bench.bridge.faults == {}


def test_a_pump_that_never_answered_is_a_fault_and_is_tried_again() -> None:
    bench = Bench()
    bench.pumps['control3'].broken = True
    bench.command_failed = None
    with pytest.raises(PumpError):
        bench.bridge.tick(bench.now)
        bench.command(100.0)
    bench.pumps['control3'].broken = False
    bench.pass_time(RETRY_PERIOD_S)
    assert 'all pumps work again' in str(bench.bridge.tick(bench.now))
    bench.command(100.0)
    assert bench.ml_h()['control1'] == 100.0


def test_delivered_rates_are_measured_between_settings(bench: Bench) -> None:
    bench.pumps['producer'].share = 0.99
    bench.command(100.0)
    assert bench.bridge.measure(bench.now) is None
    bench.pass_time(30.0)
    measured = bench.bridge.measure(bench.now)
    assert measured is not None
    assert measured.duration == pytest.approx(30.0)
    ml_h = {well: to_ml_h(rate.rate) for well, rate in measured.rates.items()}
    expected = {**SAFE_ML_H, 'control1': 100.0, 'producer': -594.0}
    assert ml_h == pytest.approx(expected)
    assert measured.rates['injector'].concentration == 1.0
    bench.pass_time(10.0)
    bench.command(200.0)
    bench.pass_time(10.0)
    second = bench.bridge.measure(bench.now)
    assert second is not None
    assert to_ml_h(second.rates['control1'].rate) == pytest.approx(200.0)


@pytest.mark.parametrize(
    ('well', 'fault', 'believed'),
    [
        ('control1', 'broken', {'control1': 100.0}),
        ('control1', 'stopped', {}),
        ('producer', 'broken', {'injector': 0.0, 'producer': -600.0}),
        ('producer', 'stopped', {'injector': 0.0, 'producer': 0.0}),
    ],
)
def test_while_a_pump_fails_the_others_are_measured(
    bench: Bench, well: str, fault: str, believed: dict[str, float]
) -> None:
    bench.command(100.0)
    bench.pass_time(10.0)
    setattr(bench.pumps[well], fault, True)
    bench.bridge.tick(bench.now)
    bench.pass_time(10.0)
    assert bench.bridge.measure(bench.now) is None  # it failed meanwhile
    for _ in range(3):  # attempts to reach it, and refused setpoints, touch no other pump
        bench.pass_time(RETRY_PERIOD_S)
        bench.bridge.tick(bench.now)
        with pytest.raises(PumpError):
            bench.command(200.0)
        measured = bench.bridge.measure(bench.now)
        assert measured is not None
        ml_h = {name: to_ml_h(rate.rate) for name, rate in measured.rates.items()}
        assert ml_h == pytest.approx(SAFE_ML_H | believed)


def test_pumps_on_a_line_that_is_gone_go_on_with_their_fluid(bench: Bench) -> None:
    bench.command(100.0)
    bench.pass_time(10.0)
    for pump in bench.pumps.values():
        pump.broken = True
    bench.bridge.tick(bench.now)
    bench.bridge.measure(bench.now)
    bench.pass_time(10.0)
    measured = bench.bridge.measure(bench.now)
    assert measured is not None
    assert measured.rates == setpoint(100.0)


def test_a_producer_that_stays_silent_never_lets_an_injector_run(bench: Bench) -> None:
    bench.pumps['producer'].broken = True
    bench.bridge.tick(bench.now)
    before = {well: pump.settings for well, pump in bench.pumps.items()}
    bench.pass_time(RETRY_PERIOD_S)
    bench.bridge.tick(bench.now)
    assert {well: pump.settings for well, pump in bench.pumps.items()} == before


def test_at_the_end_the_safe_rates_are_set(bench: Bench) -> None:
    bench.command(100.0)
    bench.bridge.go_safe(bench.now)
    assert bench.ml_h() == SAFE_ML_H


def test_pumps_make_the_announced_pauses() -> None:
    assert RIG.control is not None
    control = RIG.control.with_pauses({'injector': ((0.0, 1.0), (2.0, 3.0))}, None)
    bench = Bench(RIG.model_copy(update={'control': control}))
    assert set(bench.ml_h().values()) == {0.0}  # before the start too: nothing is drained
    bench.pumps['producer'].broken = True
    bench.bridge.tick(bench.now)
    bench.pumps['producer'].broken = False
    bench.now += 2.0 * RETRY_PERIOD_S
    assert 'work again' in str(bench.bridge.tick(bench.now))
    assert set(bench.ml_h().values()) == {0.0}
    bench.command(100.0)
    assert bench.pumps['producer'].rate_ml_h == pytest.approx(-100.0)
    for minute, injected in ((1.0, 500.0), (2.0, 0.0), (3.0, 500.0)):
        bench.bridge.elapsed = 60.0 * minute
        bench.now += 1.0
        assert 'announced pauses' in str(bench.bridge.tick(bench.now))
        assert bench.bridge.tick(bench.now) is None
        assert bench.pumps['injector'].rate_ml_h == pytest.approx(injected)
        assert bench.pumps['producer'].rate_ml_h == pytest.approx(-100.0 - injected)
    assert bench.bridge.measure(bench.now + 10.0) is None  # a pump was set meanwhile
