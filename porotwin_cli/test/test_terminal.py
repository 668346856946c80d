"""Output of the commands."""

import json
from pathlib import Path

import pytest

from porotwin_cli.terminal import print_json, print_table, refuse_existing, say
from porotwin_core.errors import InputError


def test_json_has_text_for_paths_and_null_for_nan(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({'path': Path('a') / 'b', 'errors': [0.5, float('nan')], 'rows': ({1: 'x'},)})
    expected = {'path': 'a/b', 'errors': [0.5, None], 'rows': [{'1': 'x'}]}
    assert json.loads(capsys.readouterr().out) == expected


def test_messages_go_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    say('working ...')
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ('', 'working ...\n')


def test_a_table_is_complete_in_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    print_table('figures', ('name', 'value'), [('[x]' + 60 * 'y', 1.25)])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].strip() == 'figures'
    assert any('[x]' + 60 * 'y' in line and '1.25' in line for line in lines)


def test_existing_files_are_refused(tmp_path: Path) -> None:
    refuse_existing(tmp_path / 'new')
    with pytest.raises(InputError, match='exists already'):
        refuse_existing(tmp_path)
