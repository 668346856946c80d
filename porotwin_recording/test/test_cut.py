"""A part of a recording holds what was recorded between two times, and all rates before."""

from dataclasses import replace

import numpy as np
import pytest
from recording_examples import SCHEDULE, bench_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_recording.experiment.cut import cut
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.concentration import ConcentrationWriter
from porotwin_recording.tables.recorded_data import RecordedData

TIMES = (0.0, 30.0, 60.0, 90.0)


@pytest.fixture
def recording(tmp_path):
    """Four maps; the number of a map is its concentration and its deviation in per mille."""
    folder, rig = tmp_path / 'whole', bench_rig()
    write_folder(folder, RecordedData(rig, commanded=SCHEDULE))
    grid = rig.grid(8, 6)
    with ConcentrationWriter(folder / 'concentration.nc', grid) as maps:
        for number, time in enumerate(TIMES):
            values = np.full(grid.shape, 0.1 * number)
            maps.append(time, values, deviation=0.01 * values)
    return open_recording(folder)


def test_maps_between_two_times_keep_their_times_values_and_deviations(recording):
    part = cut(recording, 30.0, 60.0)
    np.testing.assert_array_equal(part.times, [30.0, 60.0])
    np.testing.assert_allclose(part.concentration[:, 0, 0], [0.1, 0.2], rtol=1e-6)
    np.testing.assert_allclose(part.maps.deviation[1], 0.002, rtol=1e-6)
    np.testing.assert_allclose([frame.mean() for frame in part.maps], [0.1, 0.2], rtol=1e-6)


def test_rates_before_the_part_stay_and_later_ones_go(recording):
    assert cut(recording, 60.0, 90.0).commanded == SCHEDULE
    early = cut(recording, 0.0, 30.0).commanded
    assert [row.time for row in early.rows] == [0.0, 0.0]


def test_readings_after_the_part_go(recording):
    readings = tuple(
        GaugeReading(time, GaugeKind.OUTFLOW, 1e-6, 1e-7, 'out') for time in (10.0, 50.0, 80.0)
    )
    part = cut(replace(recording, readings=readings), 30.0, 60.0)
    assert [one.time for one in part.readings] == [10.0, 50.0]


def test_rates_of_a_part_were_measured_to_its_end(recording):
    """A pump that had stopped does not run again, because the commands go on."""
    asked = [(time, {'in': WellRate(time + 1e-7, 1.0)}) for time in (0.0, 30.0, 60.0, 90.0)]
    stopped = [(0.0, {'in': WellRate(1e-7, 1.0)}), (10.0, {'in': WellRate(0.0, 1.0)})]
    measured = Schedule((*Schedule.from_rates(stopped).rows, ScheduleRow(90.0, 'in', WellRate())))
    whole = replace(recording, commanded=Schedule.from_rates(asked), measured=measured)
    for end in (60.0, 75.0):
        part = cut(whole, 0.0, end)
        assert [part.delivered.at(time)['in'].rate for time in (5.0, 30.0, 60.0)] == [1e-7, 0, 0]
    assert cut(whole, 0.0, 90.0).measured == measured


def test_a_part_of_a_part_is_the_part(recording, tmp_path):
    part = cut(cut(recording, 0.0, 60.0), 30.0, 90.0)
    write_folder(tmp_path / 'part', part)
    kept = open_recording(tmp_path / 'part')
    np.testing.assert_array_equal(kept.times, [30.0, 60.0])
    np.testing.assert_allclose(kept.concentration, part.concentration)


def test_a_time_at_which_nothing_was_recorded_is_refused(recording):
    with pytest.raises(InputError, match=r'no map and no photograph from 100 to 200 s.* 0 to 90 s'):
        cut(recording, 100.0, 200.0)
