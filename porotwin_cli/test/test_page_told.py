"""Tests of the lines that tell where the page is."""

from pathlib import Path

from porotwin_cli.running.page_told import tell_page


def test_the_address_is_told_with_the_token_of_the_file(tmp_path: Path, capsys) -> None:
    token = tmp_path / 'page_token'
    token.write_text('k7mq-3xwd-p9ra\n')
    tell_page('127.0.0.1:8765', token)
    assert 'page: http://127.0.0.1:8765/#token=k7mq-3xwd-p9ra' in capsys.readouterr().err


def test_without_a_page_nothing_is_told_or_made(tmp_path: Path, capsys) -> None:
    tell_page('', tmp_path / 'page_token')
    assert capsys.readouterr().err == ''
    assert list(tmp_path.iterdir()) == []
