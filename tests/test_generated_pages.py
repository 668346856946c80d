"""The generated pages of docs show effects, faults, figures and problems as they are."""

import runpy
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).resolve().parents[1] / 'docs'
TABLES = sorted((DOCS / 'figures').glob('*.csv'))


@pytest.mark.parametrize('name', ['effects', 'faults', 'reliability', 'verification'])
def test_a_generated_page_is_up_to_date(name: str) -> None:
    script = f'make_{name}.py'
    page = runpy.run_path(str(DOCS / script))['page']()
    assert (DOCS / f'{name}.md').read_text('utf-8') == page, f'run python docs/{script}'


def test_the_parameter_file_of_bringup_is_up_to_date() -> None:
    pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')
    from porotwin_hub.launching.graph import parameter_template

    file = DOCS.parent / 'porotwin_bringup' / 'config' / 'parameters.yaml'
    told = 'run ./porotwin up --params-template > porotwin_bringup/config/parameters.yaml'
    assert file.read_text('utf-8') == parameter_template(), told


@pytest.fixture(scope='module')
def script() -> dict[str, Any]:
    return runpy.run_path(str(DOCS / 'make_reliability.py'))


@pytest.mark.parametrize('table', TABLES, ids=lambda path: path.stem)
def test_every_figure_has_its_date_subject_and_value(table: Path, script: dict[str, Any]) -> None:
    assert script['figures'](table)


@pytest.mark.parametrize(
    ('lines', 'fault'),
    [
        ('date,value\n2026-11-28,1\n', r'odd\.csv: columns'),
        ('{columns}\n2026-11-28,,,,maps,error,,,', r'odd\.csv, line 2'),
    ],
)
def test_an_odd_table_is_refused(
    script: dict[str, Any], tmp_path: Path, lines: str, fault: str
) -> None:
    text = lines.format(columns=','.join(script['COLUMNS']))
    (tmp_path / 'odd.csv').write_text(text, encoding='utf-8')
    with pytest.raises(ValueError, match=fault):
        script['figures'](tmp_path / 'odd.csv')
