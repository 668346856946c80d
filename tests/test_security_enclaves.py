"""Tests of SROS2: a node that must be protected never runs without protection."""

from pathlib import Path

import pytest
import rclpy

pytestmark = pytest.mark.graph


def test_a_node_without_keys_does_not_start(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv('ROS_SECURITY_ENABLE', 'true')
    monkeypatch.setenv('ROS_SECURITY_STRATEGY', 'Enforce')
    monkeypatch.setenv('ROS_SECURITY_KEYSTORE', str(tmp_path))
    arguments = ['--ros-args', '--enclave', '/porotwin/guard']
    with pytest.raises(RuntimeError, match='SECURITY ERROR'):
        rclpy.init(args=arguments, context=rclpy.Context())
