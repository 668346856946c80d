#!/bin/bash
set -e
source /opt/ros/jazzy/setup.bash
source /porotwin/install/setup.bash
exec "$@"
