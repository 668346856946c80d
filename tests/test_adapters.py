"""Adapters of examples/adapters: a ROS camera fills a folder for the twin."""

import runpy
import time
from pathlib import Path

import pytest

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from builtin_interfaces.msg import Time  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from sensor_msgs.msg import CompressedImage  # noqa: E402
from std_msgs.msg import Header  # noqa: E402

from porotwin_core.ros.node_thread import NodeThread  # noqa: E402

pytestmark = pytest.mark.graph

SCRIPT = Path(__file__).resolve().parents[1] / 'examples/adapters/ros_camera_to_folder.py'


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
    end = time.monotonic() + 60.0
    names = ['photo_1700000000_500000000.jpg', 'photo_1700000012_500000000.jpg']
    try:
        while not publisher.get_subscription_count():
            assert time.monotonic() < end
            time.sleep(0.02)
        for seconds in (0, 4, 8, 12):
            stamp = Time(sec=1_700_000_000 + seconds, nanosec=500_000_000)
            publisher.publish(
                CompressedImage(header=Header(stamp=stamp), format='rgb8; jpeg', data=[seconds])
            )
        while not (tmp_path / 'photos' / names[-1]).exists():
            assert time.monotonic() < end
            time.sleep(0.02)
    finally:
        thread.end()
    files = sorted((tmp_path / 'photos').iterdir())
    assert [file.name for file in files] == names
    assert [file.read_bytes() for file in files] == [b'\x00', b'\x0c']
    assert files[1].stat().st_mtime == pytest.approx(1_700_000_012.5)
