"""docs/faults.md shows the faults of the fault suite as they are."""

import importlib.util
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / 'docs'


def test_the_page_of_the_faults_is_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location('make_faults', DOCS / 'make_faults.py')
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    written = (DOCS / 'faults.md').read_text(encoding='utf-8')
    assert written == script.page(), 'run python docs/make_faults.py'
