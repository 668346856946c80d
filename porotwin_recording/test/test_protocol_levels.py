"""The log of water levels, as loggers write it."""

from datetime import UTC, datetime
from pathlib import Path

import pytest
from recording_examples import bench_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.water_levels import WaterLevels
from porotwin_core.rig import Boundaries
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.importers.protocol_answers import ProtocolAnswers
from porotwin_recording.importers.protocol_levels import with_logged_levels
from porotwin_recording.tables.recorded_data import RecordedData

BEGIN = datetime(2024, 5, 31, 10, tzinfo=UTC)
SIDES = Boundaries(top='closed', left='open', right='open', heads_m={'left': 0.47, 'right': 0.45})
RIG = bench_rig().model_copy(update={'boundaries': SIDES})


def logged(folder: Path, text: str, told: list[str]) -> RecordedData:
    path = folder / 'level_protocol.csv'
    path.write_text(text, encoding='utf-8')
    return with_logged_levels(path, RecordedData(RIG), BEGIN, ProtocolAnswers(), told)


def test_levels_are_read_in_their_units_and_as_means_of_minutes(tmp_path: Path) -> None:
    told: list[str] = []
    data = logged(
        tmp_path,
        '# Pegellogger\nDatum/Zeit;Left [cm];right [mm]\n'
        '31.05.2024 09:59:00;47,0;450\n31.05.2024 10:01:00;48,0;450\n'
        '31.05.2024 10:09:50;49,0;450\n31.05.2024 10:10:10;50,0;450\n',
        told,
    )
    minutes, heights = zip(*data.rig.levels['left'].points, strict=True)
    assert minutes == (0.0, 1.0, 10.0)
    assert heights == pytest.approx((0.475, 0.48, 0.495))
    assert any('0.475 m at time zero, in rig.yaml 0.47 m' in line for line in told)
    levels = WaterLevels.of(data.rig)
    assert levels.mean(0.0, 60.0) == pytest.approx({'left': 0.0075, 'right': 0.0})
    write_folder(tmp_path / 'experiment', data)
    rates = 'time_s,well,rate_ml_h,concentration\n0,in,100,1\n'
    (tmp_path / 'experiment' / 'rates.csv').write_text(rates, encoding='utf-8')
    assert open_recording(tmp_path / 'experiment').rig.levels == data.rig.levels


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('time,canal [cm]\n2024-05-31 10:00:00,47.1\n', 'the rig has left, right'),
        ('time,left [l]\n2024-05-31 10:00:00,47.1\n', "left.* is in 'l'"),
        ('time,left\n2024-05-31 10:00:00,47.1\n', 'levels.left is 47.1 m'),
        ('time,left [cm]\n2024-05-30 10:00:00,47.1\n', 'ends before time zero'),
        ('time,left [cm],left [mm]\n2024-05-31 10:00:00,47.1,471\n', 'which column is meant'),
        ('time,left [cm]\n2024-05-31 10:00:00,\n', 'write a number'),
    ],
)
def test_a_log_that_is_no_level_of_this_rig_is_refused(
    tmp_path: Path, text: str, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        logged(tmp_path, text, [])
