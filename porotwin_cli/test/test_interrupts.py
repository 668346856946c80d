"""Ctrl-C, SIGTERM or SIGHUP at any moment of a command ends with one line."""

import contextlib
import signal
import subprocess
import sys

import pytest
import typer

import porotwin_cli.app
from porotwin_cli.__main__ import main
from porotwin_cli.interrupts import INTERRUPTED, SIGNALS

ONE_LINE = 'porotwin: interrupted'


def test_an_interrupt_ends_with_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    stopped = typer.Typer()
    stopped.command()(interrupted)
    monkeypatch.setattr(porotwin_cli.app, 'app', stopped)
    monkeypatch.setattr(sys, 'argv', ['porotwin'])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == INTERRUPTED
    assert capsys.readouterr().err.strip() == ONE_LINE


@pytest.mark.parametrize('number', SIGNALS)
@pytest.mark.parametrize('error', [SystemError, ImportError, ValueError])
def test_a_signal_that_compiled_code_makes_another_error_of_is_told_in_one_line(
    error: type[Exception],
    number: signal.Signals,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupted(**_: object) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(number)
        raise error('initialization failed')

    monkeypatch.setattr(porotwin_cli.app, 'app', interrupted)
    monkeypatch.setattr(sys, 'argv', ['porotwin'])
    before = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
    ours = signal.signal(number, before)  # a background job may ignore it
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 128 + number
    assert capsys.readouterr().err.strip() == ONE_LINE
    assert signal.signal(number, ours) is before


def test_another_error_of_compiled_code_is_no_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(**_: object) -> None:
        raise SystemError('null argument')

    monkeypatch.setattr(porotwin_cli.app, 'app', broken)
    monkeypatch.setattr(sys, 'argv', ['porotwin'])
    with pytest.raises(SystemError, match='null argument'):
        main()


def test_ctrl_c_while_the_commands_load_is_told_in_one_line() -> None:
    code = """
import runpy, signal, sys

class Pressed:
    def find_spec(self, name, *_):
        if name == 'porotwin_cli.commands.demo':
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Pressed())
runpy.run_module('porotwin_cli', run_name='__main__')
"""
    found = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False
    )
    assert found.returncode in (INTERRUPTED, -signal.SIGINT)
    assert found.stderr.strip() == ONE_LINE
