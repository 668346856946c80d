"""./porotwin demo."""

from pathlib import Path

import pytest
from cli_examples import porotwin


@pytest.mark.parametrize('arguments', [['--speed', 'abc'], ['--speed', '-1'], ['--preset', 'abc']])
def test_demo_checks_its_options_before_it_works(arguments: list[str], tmp_path: Path) -> None:
    result = porotwin('demo', '--output', tmp_path / 'demo', *arguments)
    assert result.returncode == 2, result.stderr
    assert f"'{arguments[1]}'" in result.stderr
    assert not (tmp_path / 'demo').exists()
