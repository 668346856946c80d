"""Adapters of the examples: a ROS camera fills a folder; EPICS clients read the twin."""

import math
import os
import runpy
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from patience import PATIENCE_S, until

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from builtin_interfaces.msg import Time  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from sensor_msgs.msg import CompressedImage  # noqa: E402
from std_msgs.msg import Header  # noqa: E402

from porotwin_core.ros import qos  # noqa: E402
from porotwin_core.ros.node_thread import NodeThread  # noqa: E402
from porotwin_msgs.msg import Setpoint, WellRate  # noqa: E402

pytestmark = pytest.mark.graph

ROOT = Path(__file__).resolve().parents[1]
ADAPTERS = ROOT / 'examples' / 'adapters'
SCRIPT = ADAPTERS / 'ros_camera_to_folder.py'
SMALL_RIG = ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml'


def test_a_ros_camera_fills_a_folder(domain: int, tmp_path: Path) -> None:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    overrides = [Parameter('interval_s', value=10.0)]
    keeper = runpy.run_path(str(SCRIPT))['Keeper'](
        tmp_path / 'photos', context=context, parameter_overrides=overrides
    )
    camera = rclpy.create_node('camera', context=context)
    publisher = camera.create_publisher(CompressedImage, 'image', 10)
    thread = NodeThread(keeper, camera, threads=2)
    names = ['photo_1700000000_500000000.jpg', 'photo_1700000012_500000000.jpg']
    try:
        until(publisher.get_subscription_count)
        for seconds in (0, 4, 8, 12):
            stamp = Time(sec=1_700_000_000 + seconds, nanosec=500_000_000)
            publisher.publish(
                CompressedImage(header=Header(stamp=stamp), format='rgb8; jpeg', data=[seconds])
            )
        until((tmp_path / 'photos' / names[-1]).exists)
    finally:
        thread.end()
    files = sorted((tmp_path / 'photos').iterdir())
    assert [file.name for file in files] == names
    assert [file.read_bytes() for file in files] == [b'\x00', b'\x0c']
    assert files[1].stat().st_mtime == pytest.approx(1_700_000_012.5)


def free_port() -> int:
    with socket.socket() as made:
        made.bind(('127.0.0.1', 0))
        port: int = made.getsockname()[1]
        return port


def test_epics_clients_read_the_setpoint(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    client = pytest.importorskip('caproto.sync.client', reason='pip install caproto')
    port = str(free_port())
    monkeypatch.setenv('EPICS_CA_SERVER_PORT', port)
    monkeypatch.setenv('EPICS_CAS_SERVER_PORT', port)
    monkeypatch.setenv('EPICS_CA_ADDR_LIST', '127.0.0.1')
    monkeypatch.setenv('EPICS_CA_AUTO_ADDR_LIST', 'NO')
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    guard = rclpy.create_node('guard', namespace='porotwin', context=context)
    publisher = guard.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
    thread = NodeThread(guard)
    command = [sys.executable, str(ADAPTERS / 'epics_ioc.py'), str(SMALL_RIG), 'PTWIN:']
    with subprocess.Popen(command, env={**os.environ, 'ROS_DOMAIN_ID': str(domain)}) as server:
        try:
            until(publisher.get_subscription_count)
            read = math.nan
            while math.isnan(read):
                publisher.publish(Setpoint(wells=[WellRate(well='control1', rate=1e-6 / 36.0)]))
                answer = client.read('PTWIN:control1_ml_h', data_type='control', timeout=PATIENCE_S)
                read = answer.data[0]
            assert read == pytest.approx(100.0)
            assert answer.metadata.units == b'ml/h'
            with pytest.raises(Exception, match='cannot write'):
                client.write('PTWIN:control1_ml_h', 1.0, notify=True, timeout=PATIENCE_S)
        finally:
            server.terminate()
            assert server.wait(PATIENCE_S) == -signal.SIGTERM
            thread.end()
