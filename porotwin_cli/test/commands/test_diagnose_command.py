"""./porotwin diagnose."""

import shutil
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from cli_examples import porotwin

from porotwin_cli.commands.diagnose import Wish, _remembered, _tell_about_rig
from porotwin_diagnosis.progress import SINGLES_JUDGED


def test_diagnose_needs_recordings_or_the_running_twin(tmp_path: Path) -> None:
    result = porotwin('diagnose', '--output', tmp_path / 'out')
    assert result.returncode == 2
    assert 'name recordings, or the running twin with --live' in result.stderr


def test_a_live_diagnosis_takes_no_options_of_the_model(tmp_path: Path) -> None:
    result = porotwin('diagnose', '--live', '--output', tmp_path / 'out', '--preset', 'fast')
    assert result.returncode == 2
    assert 'leave out --rig, --preset, --apply, --each' in result.stderr


@pytest.mark.parametrize('each', [[], ['--each']])
def test_a_wrong_preset_leaves_no_folder(each: list[str], experiment: Path, tmp_path: Path) -> None:
    output = tmp_path / 'out'
    result = porotwin('diagnose', experiment, '--output', output, '--preset', 'typo', *each)
    assert result.returncode == 2
    assert "'typo'" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_copy_of_a_recording_does_not_count_twice(experiment: Path, tmp_path: Path) -> None:
    copy = tmp_path / 'copy'
    shutil.copytree(experiment, copy)
    result = porotwin('diagnose', experiment, copy, '--output', tmp_path / 'out')
    assert result.returncode == 2
    assert f'{copy}: is a copy of {experiment}' in result.stderr


@pytest.mark.parametrize(
    ('name', 'confidence', 'told'),
    [
        ('leak', 0.9, 'also writes a rig.yaml'),
        ('leak', 0.4, ''),
        ('clock', 0.9, 'clock: an effect of the camera; correct it at the camera'),
    ],
)
def test_only_a_probable_effect_of_the_rig_is_offered_for_rig_yaml(
    name: str, confidence: float, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    verdict: Any = SimpleNamespace(
        members=(name,), confidence=confidence, model=SimpleNamespace(effects=(name,))
    )
    _tell_about_rig(verdict, Path('report'), apply=False)
    said = capsys.readouterr().err
    assert told in said
    assert bool(said) == bool(told)


def test_an_improbable_effect_is_written_with_a_doubt(capsys: pytest.CaptureFixture[str]) -> None:
    verdict: Any = SimpleNamespace(
        members=('leak',),
        confidence=0.36,
        model=SimpleNamespace(effects=('leak',)),
        alternatives=(),
        not_separable=(),
    )
    _tell_about_rig(verdict, Path('report'), apply=True)
    assert 'the confidence is only 36 %: check before you use it' in capsys.readouterr().err


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_asks_for_the_answer_so_far(number: signal.Signals) -> None:
    before, wish = signal.getsignal(number), Wish(quick=False)
    with wish.on_signals():
        assert not wish.heard()
        signal.raise_signal(number)
        assert wish.heard()
        assert signal.getsignal(number) is before, 'a second one ends the program'
    assert signal.getsignal(number) is before


def test_a_second_signal_of_another_kind_ends_the_program() -> None:
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    try:
        with Wish(quick=False).on_signals():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    assert ended == [signal.SIGTERM]


def test_a_background_job_goes_on_ignoring_ctrl_c() -> None:
    before, wish = signal.signal(signal.SIGINT, signal.SIG_IGN), Wish(quick=False)
    try:
        with wish.on_signals():
            signal.raise_signal(signal.SIGINT)
            assert not wish.heard()
            signal.raise_signal(signal.SIGTERM)
            assert wish.heard()
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(('untried', 'kept'), [('', 'kept'), ('pairs of effects', 'does not keep')])
def test_a_history_tells_that_it_keeps_no_preliminary_finding(untried: str, kept: str) -> None:
    past: Any = SimpleNamespace(remember=lambda _: ['kept'])
    (line,) = _remembered(past, {'untried': untried})
    assert kept in line


def test_a_quick_search_ends_when_single_effects_are_judged() -> None:
    wish, told = Wish(quick=True), []
    show = wish.beside(lambda stage, position: told.append((stage, position)))
    show('judging', SINGLES_JUDGED / 2)
    assert not wish.heard()
    show('pairs', SINGLES_JUDGED)
    assert wish.heard()
    assert len(told) == 2
