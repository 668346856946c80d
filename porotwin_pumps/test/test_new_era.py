"""Tests of the protocol of New Era, against simulated pumps on a pseudo-terminal."""

from collections.abc import Iterator

import pytest

pytest.importorskip('serial', reason='needs pyserial; set it up with ./porotwin')

from pump_line import PumpLine

from porotwin_core.basis.errors import InputError
from porotwin_pumps.protocols.new_era import NewEraPump, _number
from porotwin_pumps.protocols.pump_protocol import PumpError
from porotwin_pumps.serial_line import SerialLine

OTHER = {'deaf': '', 'other_address': lambda said: said.replace(b'00', b'77', 1)}
"""Faults of a pump; its line has others."""


@pytest.fixture
def line() -> Iterator[PumpLine]:
    simulated = PumpLine(2)
    yield simulated
    simulated.unplug()


def connect(line: PumpLine, address: int = 0) -> NewEraPump:
    serial_line = SerialLine(line.path, 19200, timeout_s=0.3)
    return NewEraPump(serial_line, address, diameter_mm=26.7)


def test_a_pump_runs_into_and_out_of_the_rig_and_stops(line: PumpLine) -> None:
    pump, device = connect(line), line.pumps[0]
    assert (device.diameter_mm, device.state) == (26.7, 'S')
    for rate_ml_h, state in ((500.0, 'I'), (-0.125, 'W'), (1999.0, 'I'), (0.0, 'S')):
        pump.set_rate(rate_ml_h)
        assert device.running_ml_h == pytest.approx(rate_ml_h)
        assert device.state == state
        assert device.volume == (0.0 if rate_ml_h else device.volume)
        pump.check()


def test_pumps_on_one_line_are_told_apart(line: PumpLine) -> None:
    serial_line = SerialLine(line.path, 19200, timeout_s=0.3)
    first, second = (NewEraPump(serial_line, number, diameter_mm=20.0) for number in (0, 1))
    first.set_rate(10.0)
    second.set_rate(-20.0)
    assert [device.running_ml_h for device in line.pumps] == [10.0, -20.0]


def test_the_delivered_volume_is_read_back(line: PumpLine) -> None:
    pump, device = connect(line), line.pumps[0]
    device.infused_ml, device.withdrawn_ml = 12.5, 2.25
    assert pump.volume_ml() == pytest.approx(10.25)


@pytest.mark.parametrize(
    ('fault', 'words'),
    [
        ('silent', 'no answer within 0.3 s, nothing came'),
        ('partial', "no answer within 0.3 s, only b'\\x0200' came"),
        ('garbage', 'which makes no sense'),
        ('other_address', 'which makes no sense'),
        ('deaf', 'it has stopped, against its command'),
    ],
)
def test_a_pump_that_answers_wrongly_is_a_fault(line: PumpLine, fault: str, words: str) -> None:
    pump = connect(line)
    line.pumps[0].deaf = fault == 'deaf'
    line.fault = OTHER.get(fault, fault)
    with pytest.raises(PumpError) as caught:
        pump.set_rate(100.0)
    assert words in str(caught.value)
    line.pumps[0].deaf, line.fault = False, ''
    pump.set_rate(100.0)
    assert line.pumps[0].running_ml_h == 100.0


@pytest.mark.parametrize(
    ('question', 'answer'), [('DIS', 'I1..2W0.000ML'), ('DIS', 'I.W0.000ML'), ('RAT', '1.0.0MH')]
)
def test_a_number_that_was_damaged_on_the_line_is_a_fault(
    line: PumpLine, monkeypatch: pytest.MonkeyPatch, question: str, answer: str
) -> None:
    pump, device = connect(line), line.pumps[0]
    whole = device._execute

    def damaged(name: str, value: str) -> str:
        return answer if (name, value) == (question, '') else whole(name, value)

    monkeypatch.setattr(device, '_execute', damaged)
    with pytest.raises(PumpError, match=r'it answers .* when asked for its'):
        pump.set_rate(100.0)
        pump.volume_ml()


def test_alarms_are_named(line: PumpLine) -> None:
    pump = connect(line)
    pump.set_rate(100.0)
    line.pumps[0].stop_with('S')
    with pytest.raises(PumpError, match='alarm: its motor stalled'):
        pump.check()
    pump.set_rate(100.0)
    line.pumps[0].stop_with('R')
    with pytest.raises(PumpError, match='alarm: it was reset; its power was interrupted'):
        pump.check()


def test_a_pump_that_was_stopped_by_hand_is_a_fault(line: PumpLine) -> None:
    pump = connect(line)
    pump.set_rate(100.0)
    line.pumps[0].state = 'P'
    with pytest.raises(PumpError, match='it has stopped'):
        pump.check()


def test_a_rate_beyond_the_pump_is_refused_by_it(line: PumpLine) -> None:
    pump = connect(line)
    with pytest.raises(PumpError, match=r"it refuses 'RAT 2500MH': the value is out of its range"):
        pump.set_rate(2500.0)
    with pytest.raises(PumpError, match='more than the pump accepts'):
        pump.set_rate(1e300)


def test_a_line_that_is_gone_or_was_never_there_is_a_fault() -> None:
    line = PumpLine(1)
    pump = connect(line)
    line.unplug()
    with pytest.raises(PumpError, match=r'the line is gone|cannot be opened'):
        pump.check()
    with pytest.raises(PumpError, match=r'cannot be opened \(No such file or directory\)'):
        NewEraPump(SerialLine('/dev/no_such_line', 19200), 0, diameter_mm=20.0)


def test_a_line_that_another_program_uses_is_a_fault(line: PumpLine) -> None:
    pump = connect(line)
    with pytest.raises(PumpError, match='another program uses it'):
        connect(line)
    pump.check()


@pytest.mark.parametrize(('address', 'diameter_mm'), [(-1, 20.0), (100, 20.0), (0, 0.0), (0, 51.0)])
def test_wrong_options_are_refused(line: PumpLine, address: int, diameter_mm: float) -> None:
    with pytest.raises(InputError, match='give 0'):
        NewEraPump(SerialLine(line.path, 19200), address, diameter_mm=diameter_mm)


def test_numbers_have_at_most_four_digits() -> None:
    texts = [_number(value) for value in (0.001, 9.999, 12.345, 123.45, 1234.5, 9999.0)]
    assert texts == ['0.001', '9.999', '12.35', '123.5', '1234', '9999']
