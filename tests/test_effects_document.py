"""docs/effects.md lists the effects as they are."""

import importlib.util
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / 'docs'


def test_the_table_of_effects_is_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location('make_effects', DOCS / 'make_effects.py')
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    written = (DOCS / 'effects.md').read_text(encoding='utf-8')
    assert written == script.page(), 'run python docs/make_effects.py'
