"""Tests of the one reader of JSON."""

import re
from pathlib import Path

import pytest

from porotwin_core.basis.json_text import json_value

ROOT = Path(__file__).resolve().parents[2]

OWN_TEXTS = {
    'porotwin_core/porotwin_core/basis/json_text.py',
    'porotwin_core/porotwin_core/basis/netcdf_file.py',  # of the process that asks
    'porotwin_hub/porotwin_hub/launching/parameter_file.py',  # of the package
}


@pytest.mark.parametrize('text', ['[' * 200_000, '1' + '0' * 400, '{"a":' * 200_000, '{', b'\xff'])
def test_a_text_that_is_no_json_or_too_deep_is_a_value_error(text: str | bytes) -> None:
    with pytest.raises(ValueError):
        json_value(text)


def test_every_reader_of_json_asks_it() -> None:
    loads = re.compile(r'\bjson\.loads?\b')
    assert {
        str(path.relative_to(ROOT))
        for path in ROOT.glob('porotwin_*/porotwin_*/**/*.py')
        if loads.search(path.read_text(encoding='utf-8'))
    } == OWN_TEXTS
