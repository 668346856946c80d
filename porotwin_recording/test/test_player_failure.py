"""A replay that fails ends with an error, whatever the failure is."""

import sys
from pathlib import Path

import pytest

from porotwin_core.errors import InputError
from porotwin_recording import player_node

BAG = Path(__file__).resolve().parents[2] / 'bags' / 'sample'

pytestmark = pytest.mark.graph


@pytest.fixture(autouse=True)
def arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = ['-p', f'bag:={BAG}', '-p', 'discovery_s:=0.1']
    monkeypatch.setattr(sys, 'argv', ['player', '--ros-args', *arguments])


def test_an_unexpected_failure_is_an_exit_status(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError('no such luck')

    monkeypatch.setattr(player_node.PlayerNode, '_play_once', broken)
    with pytest.raises(SystemExit) as ended:
        player_node.main()
    assert ended.value.code == 1
    assert 'no such luck' in capfd.readouterr().err


def test_a_bag_of_which_nothing_can_be_played_is_refused(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def another_version(topic: object) -> None:
        raise InputError('recorded in another version')

    monkeypatch.setattr(player_node, '_installed_class', another_version)
    monkeypatch.setattr(sys, 'argv', [*sys.argv, '-p', 'topics:=all'])
    with pytest.raises(SystemExit) as ended:
        player_node.main()
    assert ended.value.code not in (0, None)
    assert 'none of the chosen topics can be played' in capfd.readouterr().err


def test_an_interrupt_before_the_bag_is_open_is_no_failure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(player_node, 'BagReader', interrupted)
    with pytest.raises(SystemExit) as ended:
        player_node.main()
    assert ended.value.code == 0
