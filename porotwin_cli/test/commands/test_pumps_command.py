"""`pumps` shows the lines to each pump, and tells every mistake in one line."""

from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from porotwin_cli.app import app
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig

SMALL_RIG = Path(__file__).resolve().parents[3] / 'porotwin_hub' / 'config' / 'small_rig.yaml'


@pytest.fixture
def pumps(tmp_path: Path) -> str:
    """A pump file for all wells of the small rig."""
    entry = {'protocol': 'new_era', 'port': '/dev/none', 'diameter_mm': 26.7, 'max_rate_ml_h': 1500}
    wells = {
        well: {**entry, 'address': number} for number, well in enumerate(load_rig(SMALL_RIG).wells)
    }
    path = tmp_path / 'pumps.yaml'
    path.write_text(yaml.safe_dump({'pumps': wells}))
    return str(path)


def test_every_command_is_shown_and_the_producer_balances(pumps: str) -> None:
    ran = CliRunner().invoke(app, ['pumps', str(SMALL_RIG), pumps, '--rate', 'control1=200'])
    assert ran.exit_code == 0, ran.output
    assert 'RAT 200.0MH' in ran.output
    assert 'RAT 700.0MH' in ran.output


@pytest.mark.parametrize('rate', ['control1=much', 'nowhere=3', 'control1=9999'])
def test_a_wrong_rate_is_refused(pumps: str, rate: str) -> None:
    ran = CliRunner().invoke(app, ['pumps', str(SMALL_RIG), pumps, '--rate', rate])
    assert isinstance(ran.exception, InputError)
