"""docs/reliability.md shows the figures of docs/figures as they are."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).resolve().parents[1] / 'docs'
TABLES = sorted((DOCS / 'figures').glob('*.csv'))


@pytest.fixture(scope='module')
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location('make_reliability', DOCS / 'make_reliability.py')
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_of_the_figures_is_up_to_date(script: ModuleType) -> None:
    written = (DOCS / 'reliability.md').read_text(encoding='utf-8')
    assert written == script.page(), 'run python docs/make_reliability.py'


@pytest.mark.parametrize('table', TABLES, ids=lambda path: path.stem)
def test_every_figure_has_its_date_subject_and_value(table: Path, script: ModuleType) -> None:
    assert script.figures(table)


def test_a_table_with_other_columns_is_refused(script: ModuleType, tmp_path: Path) -> None:
    (tmp_path / 'other.csv').write_text('date,value\n2026-11-28,1\n', encoding='utf-8')
    with pytest.raises(ValueError, match=r'other\.csv: columns'):
        script.figures(tmp_path / 'other.csv')


def test_a_figure_without_a_value_is_refused(script: ModuleType, tmp_path: Path) -> None:
    lines = [','.join(script.COLUMNS), '2026-11-28,,,,maps,error,,,']
    (tmp_path / 'empty.csv').write_text('\n'.join(lines), encoding='utf-8')
    with pytest.raises(ValueError, match=r'empty\.csv, line 2'):
        script.figures(tmp_path / 'empty.csv')
