"""The folder of a calibration is complete, or it is not there."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from porotwin_core.basis.remark import Remark
from porotwin_imaging.calibrating import calibration_pictures
from porotwin_imaging.calibrating.calibration_pictures import REFUSED, write_fit
from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused
from porotwin_imaging.tracer.calibration import Calibration, load_calibration

PICTURE = '6_mass.png'


def drawn(_: object, folder: Path) -> list[Path]:
    """Stand for the pictures."""
    (folder / PICTURE).write_bytes(b'picture')
    return [folder / PICTURE]


def interrupted(_: object, folder: Path) -> list[Path]:
    """Stand for Ctrl-C among the pictures."""
    drawn(_, folder)
    raise KeyboardInterrupt


@pytest.fixture
def target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(calibration_pictures, 'draw_fit', drawn)
    return tmp_path / 'monday-calibration'


def fit_with(*remarks: Remark) -> SimpleNamespace:
    return SimpleNamespace(calibration=Calibration(), remarks=remarks, lines=['a line of the fit'])


GOOD = fit_with()
BAD = fit_with(Remark('calibration', '', 'too much tracer', 'weigh it', refused=True))


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_calibration_is_put_in_its_place(target: Path) -> None:
    assert write_fit(GOOD, target) == [target / PICTURE]
    assert names(target) == {PICTURE, 'calibration.yaml'}
    assert names(target.parent) == {target.name}


def test_an_interruption_leaves_nothing_that_blocks_the_next_call(
    target: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibration_pictures, 'draw_fit', interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_fit(GOOD, target)
    assert names(target.parent) == set()


def test_the_rest_of_a_killed_call_is_removed(target: Path) -> None:
    rest = target.with_name(f'.{target.name}.partial')
    rest.mkdir()
    (rest / 'old.png').touch()
    write_fit(GOOD, target)
    assert names(target) == {PICTURE, 'calibration.yaml'}
    assert names(target.parent) == {target.name}


def test_a_refusal_tells_its_reasons_and_is_replaced_by_the_next_calibration(target: Path) -> None:
    with pytest.raises(CalibrationRefused, match='too much tracer') as refusal:
        write_fit(BAD, target)
    assert refusal.value.picture == target / PICTURE
    assert refusal.value.lines == ('a line of the fit',)
    assert names(target) == {PICTURE, REFUSED}
    write_fit(GOOD, target)
    assert names(target) == {PICTURE, 'calibration.yaml'}
    load_calibration(target / 'calibration.yaml')
