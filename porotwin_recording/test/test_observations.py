"""Tests of observations.csv: readings come back as written, and faults of a table are named."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lab.blind.blind_cases import SMALL
from porotwin_core.basis.errors import InputError
from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading
from porotwin_core.rig.sections import Boundaries
from porotwin_recording.tables.observations import HEADER, read_readings, write_readings

FINITE = st.floats(0.0, 1.0, allow_subnormal=False)


@given(time=st.floats(0, 1e6), value=FINITE, deviation=st.floats(1e-6, 1.0), x=FINITE, z=FINITE)
def test_readings_come_back(
    tmp_path_factory: pytest.TempPathFactory,
    time: float,
    value: float,
    deviation: float,
    x: float,
    z: float,
) -> None:
    path = tmp_path_factory.getbasetemp() / 'observations.csv'
    port, other = (x * SMALL.width_m, z * SMALL.height_m), (0.1, 0.1)
    readings = (
        GaugeReading(time, GaugeKind.PRESSURE, value, deviation, port=port),
        GaugeReading(time, GaugeKind.PRESSURE, -value, deviation, port=port, against=other),
        GaugeReading(time, GaugeKind.CONCENTRATION, value, deviation, 'producer'),
        GaugeReading(time, GaugeKind.OUTFLOW, -value * 1e-6, deviation * 1e-6, 'top'),
    )
    write_readings(path, readings)
    back = read_readings(path, SMALL)
    assert back[:3] == readings[:3]
    assert back[3].value == pytest.approx(readings[3].value, rel=1e-15)
    assert back[3].place == 'top'


@pytest.mark.parametrize(
    ('line', 'complaint'),
    [
        ('-1,outflow_ml,producer,,3,1', 'negative'),
        ('1e9,outflow_ml,producer,,3,1', 'year'),
        ('60,outflow_l,producer,,3,1', 'outflow_ml'),
        ('60,outflow_ml,drain,,3,1', 'producer'),
        ('60,outflow_ml,producer,,3,0', 'above 0'),
        ('60,outflow_ml,producer,,nan,1', 'value'),
        ('60,outflow_ml,producer,top,3,1', 'against'),
        ('60,concentration,producer,,40,1', 'between 0'),
        ('60,pressure_pa,producer,,3,1', 'x and z in metres'),
        ('60,pressure_pa,300 100,,3,1', 'outside the sand'),
    ],
)
def test_a_wrong_reading_is_refused(tmp_path: Path, line: str, complaint: str) -> None:
    path = tmp_path / 'observations.csv'
    path.write_text(f'{",".join(HEADER)}\n{line}\n')
    with pytest.raises(InputError, match=complaint) as refused:
        read_readings(path, SMALL)
    assert str(refused.value).startswith(f'{path}:2')


def test_a_pressure_in_a_closed_rig_needs_a_second_port(tmp_path: Path) -> None:
    path = tmp_path / 'observations.csv'
    path.write_text(f'{",".join(HEADER)}\n60,pressure_pa,0.1 0.1,,3,1\n')
    closed = SMALL.model_copy(update={'boundaries': Boundaries(top='closed')})
    with pytest.raises(InputError, match='second port'):
        read_readings(path, closed)
