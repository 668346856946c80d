"""Tests of the file of the pumps: every mistake is one line that names the well."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_pumps.pump_file import load_pumps, pump_openers

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')


def good() -> dict[str, Any]:
    pumps = {
        well: {
            'protocol': 'new_era',
            'port': '/dev/ttyUSB0',
            'address': number,
            'diameter_mm': 26.7,
            'max_rate_ml_h': 1500.0,
        }
        for number, well in enumerate(RIG.wells)
    }
    return {'pumps': pumps}


def written(folder: Path, data: Any) -> Path:
    path = folder / 'pumps.yaml'
    path.write_text(data if isinstance(data, str) else yaml.safe_dump(data))
    return path


def test_every_well_has_its_pump(tmp_path: Path) -> None:
    pumps = load_pumps(written(tmp_path, good()), RIG)
    assert set(pumps) == set(pump_openers(pumps)) == set(RIG.wells)
    assert pumps['control1'].options == {'diameter_mm': 26.7}


@pytest.mark.parametrize(
    ('well', 'changes', 'line'),
    [
        ('control1', {'protocol': 'telepathy'}, "no protocol is named 'telepathy'; known: harvard"),
        ('control1', {'port': None}, 'pump of control1: port'),
        ('control1', {'address': -1}, 'pump of control1: address'),
        ('control1', {'address': 0}, "'control1' and 'injector' are both at address 0"),
        ('control1', {'baud': 9600}, '/dev/ttyUSB0 has two speeds'),
        ('control1', {'parity': 'E'}, '/dev/ttyUSB0 has two speeds'),
        ('control1', {'parity': 'X'}, 'pump of control1: parity'),
        ('control1', {'max_rate_ml_h': 400.0}, "'control1' runs at up to 400 ml/h, rig.yaml asks"),
        ('producer', {'max_rate_ml_h': 900.0}, 'rig.yaml asks for 1000'),
        ('control1', {'max_rate_ml_h': float('inf')}, 'pump of control1: max_rate_ml_h'),
        ('control1', {'diameter': 26.7}, "unknown key 'diameter'; new_era has ['diameter_mm']"),
        ('control1', {'diameter_mm': 'wide'}, "diameter_mm = 'wide': give a number"),
        ('control1', {'diameter_mm': None}, 'give a number'),
        ('nowhere', {'protocol': 'new_era', 'port': 'x', 'max_rate_ml_h': 1.0, 'diameter_mm': 1.0},
         "well 'nowhere' is not in rig.yaml"),
    ],
)  # fmt: skip
def test_a_wrong_entry_is_named(
    tmp_path: Path, well: str, changes: dict[str, Any], line: str
) -> None:
    data = good()
    data['pumps'][well] = {**data['pumps'].get(well, {}), **changes}
    with pytest.raises(InputError) as caught:
        load_pumps(written(tmp_path, data), RIG)
    assert line in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_well_in_use_needs_a_pump_and_an_idle_one_does_not(tmp_path: Path) -> None:
    data = good()
    del data['pumps']['control2']
    with pytest.raises(InputError, match="well 'control2' has no pump"):
        load_pumps(written(tmp_path, data), RIG)
    del data['pumps']['control1']['diameter_mm']
    with pytest.raises(InputError, match="'diameter_mm' is missing: inner diameter"):
        load_pumps(written(tmp_path, data), RIG)


@pytest.mark.parametrize(
    'text', ['', '[1, 2]', 'pumps: 5', 'pumps: {}\nmore: 1', 'a: [', '\x00', 'pumps: {}\n' * 2]
)
def test_a_file_that_is_no_list_of_pumps_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError):
        load_pumps(written(tmp_path, text), RIG)
    with pytest.raises(InputError, match='no such file'):
        load_pumps(tmp_path / 'none.yaml', RIG)
    with pytest.raises(InputError, match='no control section'):
        load_pumps(written(tmp_path, good()), RIG.model_copy(update={'control': None}))
