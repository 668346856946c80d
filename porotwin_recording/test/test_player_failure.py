"""A replay that fails ends with an error, whatever the failure is."""

import os
import sys
from pathlib import Path

import pytest

from porotwin_recording import player_node

BAG = Path(__file__).resolve().parents[2] / 'bags' / 'sample'

pytestmark = pytest.mark.graph


def test_an_unexpected_failure_is_an_exit_status(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError('no such luck')

    monkeypatch.setenv('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    monkeypatch.setattr(player_node.PlayerNode, '_play_once', broken)
    arguments = ['-p', f'bag:={BAG}', '-p', 'discovery_s:=0.1']
    monkeypatch.setattr(sys, 'argv', ['player', '--ros-args', *arguments])
    with pytest.raises(SystemExit) as ended:
        player_node.main()
    assert ended.value.code == 1
    assert 'no such luck' in capfd.readouterr().err
