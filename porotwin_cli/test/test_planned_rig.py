"""The plan of the pumps beside a rig that runs live."""

import shutil
from pathlib import Path

import pytest

from porotwin_cli.checking.rig_check import check, in_words
from porotwin_cli.options.planned_rig import planned_rig
from porotwin_cli.running.closed_loop import usual_minutes
from porotwin_cli.workspace import ROOT
from porotwin_core.basis.errors import InputError

FOLDER = ROOT / 'rigs' / 'two_sands'
RESTS = """time_s,well,rate_ml_h,concentration
0,injector,300,1
600,injector,0,1
1200,injector,300,1
2400,injector,0,1
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(FOLDER, tmp_path / 'rig'))


@pytest.mark.parametrize('name', ['', 'rig.yaml'])
def test_a_plan_beside_the_rig_is_followed_and_told(
    folder: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / 'rates.csv').write_text(RESTS)
    planned = planned_rig(folder / name)
    assert planned.control is not None
    assert planned.control.fixed['injector'].pauses_min == ((10.0, 20.0),)
    assert usual_minutes(planned, hidden=False) == 40.0
    assert 'injector rests from 10 to 20 min' in capsys.readouterr().err


def test_the_rates_of_a_recording_are_no_plan(folder: Path) -> None:
    (folder / 'rates.csv').write_text(RESTS)
    (folder / 'rates_measured.csv').write_text(RESTS)
    planned = planned_rig(folder)
    assert planned.control is not None
    assert planned.control.fixed['injector'].pauses_min == ()


def test_a_plan_with_another_rate_than_the_rig_is_refused(folder: Path) -> None:
    (folder / 'rates.csv').write_text(RESTS.replace('1200,injector,300', '1200,injector,200'))
    with pytest.raises(InputError, match=r'rates\.csv: injector pumps 200 ml/h at 1200 s'):
        planned_rig(folder)


def test_a_plan_that_pumps_in_a_pause_of_the_rig_is_told(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / 'rates.csv').write_text(RESTS)
    planned_rig(folder)
    assert not caplog.messages
    text = (folder / 'rig.yaml').read_text()
    with_pause = text.replace('concentration: 1.0', 'concentration: 1.0, pauses_min: [[25, 30]]')
    assert with_pause != text
    (folder / 'rig.yaml').write_text(with_pause)
    planned = planned_rig(folder)
    assert planned.control is not None
    assert planned.control.fixed['injector'].pauses_min == ((10.0, 20.0), (25.0, 30.0))
    (told,) = caplog.messages
    assert 'injector pumps from 25 to 30 min' in told


def test_what_check_finds_odd_in_a_run_is_told_by_up_and_demo(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Only `check` told an empty bottle, an effect that begins too late, and one of the camera."""
    text = (folder / 'rig.yaml').read_text()
    light = '{name: illumination, parameters: {drift: -1.0e-5, since: 1.0e6}}'
    few = text.replace('control:\n', 'control:\n  stock_ml: 10\n  end_min: 60\n')
    (folder / 'rig.yaml').write_text(f'{few}\neffects: [{light}]\n')
    planned_rig(folder)
    told = {str(remark) for remark in check(folder).remarks}
    assert set(caplog.messages) == told
    assert {one.code for one in check(folder).remarks} == {
        'empty_bottle', 'late_effect', 'camera_effect',
    }  # fmt: skip


def test_a_check_tells_the_plan_that_up_follows_or_refuses(folder: Path) -> None:
    (folder / 'rates.csv').write_text(RESTS)
    checked = check(folder / 'rig.yaml')
    assert checked.planned == check(folder).planned == planned_rig(folder)
    assert any('injector rests from 10 to 20 min' in line for line in in_words(checked))
    (folder / 'rates.csv').write_text(RESTS.replace('1200,injector,300', '1200,injector,200'))
    checked = check(folder)
    assert checked.runs, 'rehearse runs it'
    assert any('demo and up refuse' in one.key for one in checked.remarks)


def test_a_leak_that_no_well_balances_starts_no_twin(folder: Path) -> None:
    """Only `check` told it; the hub of `up` could predict nothing."""
    text = (folder / 'rig.yaml').read_text().replace('{top: open', '{top: closed')
    leak = 'effects: [{name: leak, parameters: {x: 0.4, z: 0.2, rate: -50.0}}]\n'
    (folder / 'rig.yaml').write_text(f'{text}\n{leak}')
    with pytest.raises(InputError, match=r'leak.* but all sides are closed'):
        planned_rig(folder)


def test_the_twin_balances_a_plan_that_leaves_the_producer_out(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = (folder / 'rig.yaml').read_text().replace('{top: open', '{top: closed')
    weak = 'effects: [{name: rate, parameters: {well: injector, factor: 0.9}}]\n'
    (folder / 'rig.yaml').write_text(f'{text}\n{weak}')
    (folder / 'rates.csv').write_text(RESTS)
    planned_rig(folder)
    assert not caplog.messages
