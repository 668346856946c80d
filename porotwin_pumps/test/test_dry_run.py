"""A dry run tells all that a real run would send."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from pump_line import PumpLine

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig
from porotwin_pumps.bridge import PumpBridge
from porotwin_pumps.dry_run import dry_run
from porotwin_pumps.protocols.protocol_registry import PROTOCOLS
from porotwin_pumps.pump_file import PumpEntry, load_pumps, pump_openers

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
RATES = {
    **safe_rates(RIG),
    'control1': WellRate(from_ml_h(200.0)),
    'producer': WellRate(from_ml_h(-700.0)),
}


def pumps_at(port: str, folder: Path) -> dict[str, PumpEntry]:
    entry = {'protocol': 'new_era', 'port': port, 'diameter_mm': 26.7, 'max_rate_ml_h': 1500.0}
    pumps = {well: {**entry, 'address': number} for number, well in enumerate(RIG.wells)}
    path = folder / 'pumps.yaml'
    path.write_text(yaml.safe_dump({'pumps': pumps}))
    return load_pumps(path, RIG)


def test_a_simulated_pump_gets_the_same_commands(tmp_path: Path) -> None:
    pytest.importorskip('serial', reason='needs pyserial; set it up with ./porotwin')
    lines: list[str] = []
    dry_run(RIG, pumps_at('/dev/nowhere', tmp_path), RATES, lines.append)
    rack = PumpLine(len(RIG.wells))
    try:
        for pump in rack.pumps:
            pump.alarm = ''
        pumps = pumps_at(rack.path, tmp_path)
        limits = dict.fromkeys(pumps, 1500.0)
        bridge = PumpBridge(RIG, pump_openers(pumps), max_rates_ml_h=limits, now=0.0)
        bridge.command(RATES, until=1.0, now=0.0)
        bridge.tick(1.0)
        bridge.go_safe(1.0)
        sent = [pump.commands for pump in rack.pumps]
    finally:
        rack.unplug()
    questions = [line.split('  ')[1] for line in lines if '->' in line]
    for number, commands in enumerate(sent):
        own = [one[2:].removesuffix('\\r') for one in questions if one[:2] == f'{number:02d}']
        assert [one.replace(' ', '') for one in own] == [one.replace(' ', '') for one in commands]


@pytest.mark.parametrize('name', ['harvard', 'masterflex', 'modbus_rtu', 'new_era'])
def test_every_protocol_has_a_dry_run(name: str, tmp_path: Path) -> None:
    if name == 'modbus_rtu':
        pytest.importorskip('pymodbus', reason='needs pymodbus; pip install pymodbus')
    values = {'diameter_mm': 26.7, 'ml_per_turn': 0.8, 'ml_h_per_unit': 60.0}
    registers = ('rate_register', 'run_register', 'direction_register', 'volume_register')
    values |= {register: 2 * number for number, register in enumerate(registers)}
    entry = {'protocol': name, 'port': '/dev/nowhere', 'max_rate_ml_h': 1500.0}
    entry |= {option: values[option] for option in PROTOCOLS[name].options}
    path = tmp_path / 'pumps.yaml'
    pumps = {well: {**entry, 'address': number} for number, well in enumerate(RIG.wells, 1)}
    path.write_text(yaml.safe_dump({'pumps': pumps}))
    lines: list[str] = []
    dry_run(RIG, load_pumps(path, RIG), RATES, lines.append)
    assert sum('->' in line for line in lines) > 30


def test_a_protocol_without_a_dry_run_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pumps = pumps_at('/dev/nowhere', tmp_path)
    other = {well: one.model_copy(update={'protocol': 'bare'}) for well, one in pumps.items()}
    monkeypatch.setitem(PROTOCOLS, 'bare', replace(PROTOCOLS['new_era'], pretend=None))
    with pytest.raises(InputError, match='bare: has no dry run'):
        dry_run(RIG, other, RATES, print)
