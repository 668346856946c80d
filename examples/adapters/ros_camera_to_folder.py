"""Keep a photograph of a ROS camera every 30 s, for `./porotwin up --photos FOLDER`.

    python examples/adapters/ros_camera_to_folder.py FOLDER \\
        --ros-args -r image:=/image_raw/compressed -p interval_s:=30.0

`v4l2_camera`, `usb_cam` and `camera_ros` publish `image_raw/compressed` once the package
`compressed_image_transport` is installed. Fix exposure, white balance and focus by their
parameters. The file gets the time of the message, which the twin reads as the time of exposure.
"""

import os
import sys
from pathlib import Path

import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import CompressedImage

from porotwin_core.basis.whole_file import whole_file


class Keeper(Node):
    """Writes one photograph of each interval as a file."""

    def __init__(self, folder: Path, **kwargs: object) -> None:
        super().__init__('photo_keeper', **kwargs)
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._interval = self.declare_parameter('interval_s', 30.0).value
        self._last = float('-inf')
        self.create_subscription(CompressedImage, 'image', self._keep, qos_profile_sensor_data)

    def _keep(self, message: CompressedImage) -> None:
        stamp = message.header.stamp
        time = stamp.sec + 1e-9 * stamp.nanosec
        if time - self._last < self._interval:
            return
        self._last = time
        kind = 'png' if 'png' in message.format else 'jpg'
        with whole_file(self._folder / f'photo_{stamp.sec}_{stamp.nanosec:09d}.{kind}') as path:
            path.write_bytes(bytes(message.data))
            os.utime(path, (time, time))


def main() -> None:
    """Run until Ctrl-C."""
    rclpy.init()
    rclpy.spin(Keeper(Path(remove_ros_args(sys.argv)[1])))


if __name__ == '__main__':
    main()
