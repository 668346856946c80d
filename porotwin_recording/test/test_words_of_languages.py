"""Tables with heads, units and signs of other languages and programs."""

from pathlib import Path

import pytest
from recording_examples import bench_rig

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_recording.experiment.experiment_folder import read_folder
from porotwin_recording.importers.foreign_units import rate_factor, time_factor
from porotwin_recording.importers.protocol_answers import ProtocolAnswers
from porotwin_recording.importers.protocol_import import import_protocols

MINUS = '\u2212'
GERMAN = (
    'Beginn;Ende;Förderrate (ml·h⁻¹);Brunnen;Konzentration\n'
    '31.05.2024 14:30;31.05.2024 15:30;1,5;in;1\n'
    f'31.05.2024 14:30;31.05.2024 15:30;{MINUS}1,5;out;\n'
)


def rates_of(tmp_path: Path, data: bytes, **answers: object) -> list[tuple[float, str, float]]:
    lab, made = tmp_path / 'lab', tmp_path / 'made'
    lab.mkdir()
    (lab / 'injection_protocol.csv').write_bytes(data)
    import_protocols(lab, made, bench_rig(), ProtocolAnswers(**answers))
    schedule = read_folder(made).commanded
    assert schedule is not None
    return [(row.time, row.well, round(to_ml_h(row.rate.rate), 6)) for row in schedule.rows]


@pytest.mark.parametrize(
    'text',
    [
        GERMAN,
        'Pumpe Nr. 7;;;;\n# Labor;Halle\n' + GERMAN,
        GERMAN.replace('Konzentration\n', 'Konzentration;\n').replace(';1\n', ';1;\n'),
        GERMAN.replace(';', '\t'),
        'sep=;\n' + GERMAN,
        GERMAN.replace('Beginn;Ende;Förderrate (ml·h⁻¹)', 'Début;Fin;Débit en ml/heure'),
        GERMAN.replace('Beginn;Ende;Förderrate (ml·h⁻¹)', 'Starttid;Slut;Flöde [ml/timme]'),
        GERMAN.replace('Beginn;Ende;Förderrate (ml·h⁻¹)', 'Fra;Til;Pumperate [ml/time]'),
        GERMAN.replace('Beginn;Ende;Förderrate (ml·h⁻¹)', 'Alku;Loppu;Virtaus [ml/tunti]'),
        GERMAN.replace('Beginn;Ende;Förderrate (ml·h⁻¹)', 'Inicio;Fin;Caudal (ml/hora)'),
        GERMAN.replace('Beginn;Ende;Förderrate (ml·h⁻¹)', 'Inizio;Fine;Portata (ml/ora)'),
        GERMAN.replace('Beginn;Ende;Förderrate (ml·h⁻¹)', 'Begin;Einde;Debiet (ml/uur)'),
        GERMAN.replace(' (ml·h⁻¹)', '').replace('tion\n', 'tion\n;;ml/h;;-\n', 1),
    ],
    ids=[
        *('plain', 'preamble', 'trailing', 'tabs', 'sep'),
        *('fr', 'sv', 'no', 'fi', 'es', 'it', 'nl', 'units'),
    ],
)
@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16', 'utf-16-le'])
def test_a_log_of_a_spreadsheet_is_read(tmp_path: Path, text: str, encoding: str) -> None:
    assert rates_of(tmp_path, text.encode(encoding)) == [
        (0.0, 'in', 1.5),
        (0.0, 'out', -1.5),
        (3600.0, 'in', 0.0),
        (3600.0, 'out', 0.0),
    ]


def test_dates_and_times_in_two_columns_are_joined(tmp_path: Path) -> None:
    text = 'Datum;Uhrzeit;Rate [ml/h];Pumpe;Konz\n31.05.2024;23:30;5,5;in;1\n1.6.2024;0:30;0;in;0\n'
    assert rates_of(tmp_path, text.encode()) == [(0.0, 'in', 5.5), (3600.0, 'in', 0.0)]


@pytest.mark.parametrize(
    'unit',
    ['ml/h', 'mL h-1', 'ml·h⁻¹', f'ml·h{MINUS}1', 'ml.h^-1', 'ml pro Std.', 'cm³/Stunde', 'ccm/hr'],
)
def test_one_unit_has_many_spellings(unit: str) -> None:
    found = rate_factor(unit, 'p.csv: rate', density_kg_m3=1000.0)
    assert found == pytest.approx(1e-6 / 3600.0)


@pytest.mark.parametrize('unit', ['month', 'years', '', 's**9'])
def test_times_without_one_length_are_refused(unit: str) -> None:
    with pytest.raises(InputError, match='no unit'):
        time_factor(unit, 'maps.nc: time')


def test_only_answers_that_read_all_of_the_input_are_proposed(tmp_path: Path) -> None:
    text = 'well,start,end,rate [ml/h],concentration\n'
    row = 'in,3/4/2024 10:00,4/3/2024 11:00,5,1\n'  # ends before its start if months are first
    with pytest.raises(InputError) as error:
        rates_of(tmp_path, (text + row.replace('4/3', '3/5')).encode())
    assert '--date-order day-first' in str(error.value)
    (tmp_path / 'other').mkdir()
    with pytest.raises(InputError) as error:
        rates_of(tmp_path / 'other', (text + row).encode())
    assert '--date-order month-first (' in str(error.value)
    assert 'day-first' not in str(error.value)
