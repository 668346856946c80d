"""Tests of the operator's voice, with a real espeak-ng where there is one."""

import shutil
import sys
import threading
import time
import wave
from pathlib import Path

import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_hub.operator.announcement import announce_expiry
from porotwin_hub.operator.voice import Voice


def wait_for_file(path: Path) -> None:
    deadline = time.monotonic() + 60.0
    while not path.is_file() or path.stat().st_size == 0:
        assert time.monotonic() < deadline
        time.sleep(0.02)


def fake_espeak(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a program called espeak-ng before all others."""
    program = folder / 'espeak-ng'
    program.write_text(f'#!/bin/sh\n{script}\n')
    program.chmod(0o755)
    monkeypatch.setenv('PATH', f'{folder}:/usr/bin:/bin')


@pytest.mark.skipif(shutil.which('espeak-ng') is None, reason='espeak-ng is not installed')
def test_an_announcement_is_heard_in_a_sound_file(tmp_path: Path) -> None:
    safe = {'injector': WellRate(from_ml_h(500.0), 1.0), 'control1': WellRate()}
    sound = tmp_path / 'speech.wav'
    voice = Voice(options=('-w', str(sound)))
    voice.say(announce_expiry(7, safe, {}).speech)
    wait_for_file(sound)
    deadline = time.monotonic() + 60.0
    seconds = 0.0
    while seconds < 2.0 and time.monotonic() < deadline:
        try:
            with wave.open(str(sound)) as file:
                samples = file.readframes(file.getnframes())
                seconds = len(samples) / (file.getsampwidth() * file.getframerate())
        except (wave.Error, EOFError):  # still being written
            seconds = 0.0
        time.sleep(0.02)
    assert seconds > 2.0
    assert any(samples)


def test_the_words_reach_espeak_as_text_whatever_they_begin_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_espeak(
        tmp_path,
        f'cat > {tmp_path}/heard.part\nmv {tmp_path}/heard.part {tmp_path}/heard',
        monkeypatch,
    )
    Voice().say('-w set control 1 to 40.')
    wait_for_file(tmp_path / 'heard')
    assert (tmp_path / 'heard').read_text() == '-w set control 1 to 40.'


def test_speech_that_fails_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_espeak(tmp_path, 'cat > /dev/null; echo "no audio device" >&2; exit 1', monkeypatch)
    problems: list[str] = []
    reported = threading.Event()

    def keep(text: str) -> None:
        problems.append(text)
        reported.set()

    Voice(on_problem=keep).say('Set control 1 to 40.')
    assert reported.wait(60.0)
    assert problems == ['nothing was spoken: espeak-ng says no audio device; check the sound card']


def test_without_espeak_nothing_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv('PATH', str(tmp_path))
    voice = Voice()
    assert voice.program is None
    voice.say('Set control 1 to 40.')


def test_a_waiting_order_is_dropped_only_if_all_its_wells_are_told_anew(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake_espeak(tmp_path, 'exit 0', monkeypatch)
    begun, free, done = (threading.Event() for _ in range(3))
    spoken: list[str] = []

    def speak(_: Voice, __: str, sentence: str) -> None:
        spoken.append(sentence)
        begun.set()
        assert free.wait(60.0)
        if sentence == 'last':
            done.set()

    monkeypatch.setattr(Voice, '_speak', speak)
    voice = Voice()
    voice.say('now', ['control1'])
    assert begun.wait(60.0)
    voice.say('old', ['control1'])
    voice.say('new', ['control1', 'producer'])
    voice.say('other', ['control2', 'producer'])
    voice.say('last', ['model'])
    free.set()
    assert done.wait(60.0)
    assert spoken == ['now', 'new', 'other', 'last']


def test_the_speaker_may_take_a_sentence_while_the_next_one_comes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake_espeak(tmp_path, 'exit 0', monkeypatch)
    monkeypatch.setattr(Voice, '_speak', lambda *_: None)
    voice = Voice()
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)  # the threads meet often
    try:
        for number in range(20_000):
            voice.say(f'Set control 1 to {number}.')
    finally:
        sys.setswitchinterval(before)
