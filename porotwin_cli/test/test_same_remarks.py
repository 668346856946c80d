"""A wrong recording is told by every command in the same words."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from box_rig import box_rig

from porotwin_checks.all_checks import CHECKS, OF_TABLES, remarks_about
from porotwin_checks.known import Known
from porotwin_cli.checking import rig_check
from porotwin_cli.commands import calibrate, diagnose, image, import_
from porotwin_core.basis.check import Check
from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Boundaries, Camera, EffectDescription
from porotwin_diagnosis import examine
from porotwin_recording.experiment.experiment_folder import folder_data, write_folder
from porotwin_recording.tables.concentration import ConcentrationWriter, MapOrigin, open_maps
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData

CAMERA = Camera(corners_px=((0, 0), (0, 39), (59, 39), (59, 0)))
RIG = box_rig(left=(0.1, 0.2), right=(0.4, 0.1)).model_copy(
    update={'boundaries': Boundaries(top='open'), 'camera': CAMERA}
)
STOCK = WellRate(0.3e-6, 1.0)
TIMES = [120.0 * number for number in range(10)]
"""Of maps with a growing disc around the left well [s]."""


def rates(well: str = 'left', *, begin: float = 0.0, factor: float = 1.0) -> Schedule:
    """Return a log of the injection, with the rates multiplied by `factor`."""
    return Schedule((ScheduleRow(begin, well, WellRate(factor * STOCK.rate, 1.0)),))


WRONG = {
    'ml/min': (rates(factor=1 / 60), {'little_injected', 'too_much_tracer'}),
    'late log': (rates(begin=7200.0), {'other_times', 'too_much_tracer'}),
    'exchanged wells': (rates('right'), {'pale_well'}),
    'late effect': (rates(), {'late_effect'}),
}
"""Logs by their fault, each with codes that must be told."""

LATE = EffectDescription(name='rate', parameters={'well': 'right', 'factor': 0.5, 'since': 1e6})


@pytest.fixture(params=WRONG)
def recording(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, set[str]]:
    """Return a recording with a wrong log, and codes that must be told."""
    log, codes = WRONG[request.param]
    grid = RIG.grid(60, 40)
    away = np.hypot(grid.x[None, :] - 0.1, grid.z[:, None] - 0.2)
    with ConcentrationWriter(tmp_path / 'maps.nc', grid, origin=MapOrigin(True)) as writer:
        for time in TIMES:
            reached = np.sqrt(STOCK.rate * time / (0.4 * 0.02 * np.pi))
            writer.append(time, (away < reached).astype(np.float32))
    grey = cv2.imencode('.jpg', np.full((40, 60, 3), 90, np.uint8))[1].tobytes()
    photos = (
        Photo(TIMES[0], 'baseline', 'photos/0.jpg', partial(bytes, grey)),
        *(Photo(time, 'state', f'photos/{time:g}.jpg', partial(bytes, grey)) for time in TIMES[1:]),
    )
    rig = RIG.model_copy(update={'effects': (LATE,)}) if 'late_effect' in codes else RIG
    data = RecordedData(
        rig, commanded=log, maps=open_maps(tmp_path / 'maps.nc', RIG), photos=photos
    )
    write_folder(tmp_path / 'run', data)
    return tmp_path / 'run', codes


class EnoughError(InputError):
    """The command has told its remarks."""


def enough(*_: object, **__: object) -> None:
    raise EnoughError('enough')


def ask_diagnose(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examine, 'settled', enough)
    diagnose.command(folder.parent / 'report', [folder])


def ask_calibrate(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibrate, '_check_photos', enough)
    calibrate.command(folder)


def ask_image(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image, '_memory', enough)
    image.command(folder, folder.parent / 'new.nc')


def ask_import(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import_.command(folder, folder.parent / 'bag')


def ask_check(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    print(*rig_check.check(folder).remarks, sep='\n')


@pytest.mark.usefixtures('undrawn')
@pytest.mark.parametrize(
    ('ask', 'checks'),
    [
        (ask_check, CHECKS),
        (ask_import, CHECKS),
        (ask_calibrate, CHECKS),
        (ask_diagnose, CHECKS),
        (ask_image, OF_TABLES),  # the maps of the folder are not those that it makes
    ],
)
def test_every_command_tells_a_wrong_recording_in_the_same_words(
    ask: Callable[[Path, pytest.MonkeyPatch], None],
    checks: Mapping[str, Check[Known]],
    recording: tuple[Path, set[str]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    folder, codes = recording
    with suppress(EnoughError):
        ask(folder, monkeypatch)
    words = caplog.text + ''.join(capsys.readouterr())
    wanted = {one.code: str(one) for one in remarks_about(folder_data(folder).known(), checks)}
    assert codes <= {one.code for one in remarks_about(folder_data(folder).known())}
    assert {code for code, line in wanted.items() if line in words} == set(wanted)
