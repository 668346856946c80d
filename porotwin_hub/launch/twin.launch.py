"""The twin beside a real rig: ros2 launch porotwin_hub twin.launch.py rig:=... photos:=..."""

import dataclasses
import types
import typing
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from porotwin_hub.graph import NAMESPACE, GraphSettings, live_graph


def converted(text: str, hint: object) -> object:
    """Return an argument's text as the type of its field; empty is None for optional paths."""
    if isinstance(hint, types.UnionType):
        return Path(text) if text else None
    if hint is bool:
        return text.lower() in ('true', '1', 'yes')
    return typing.cast(type, hint)(text)


def nodes(context: LaunchContext) -> list[Node]:
    """Return the launch actions for the arguments given."""
    hints = typing.get_type_hints(GraphSettings)
    values = {
        name: converted(LaunchConfiguration(name).perform(context), hint)
        for name, hint in hints.items()
    }
    return [
        Node(
            package=node.package,
            executable=node.executable,
            name=node.name,
            namespace=NAMESPACE,
            parameters=[dict(node.parameters)],
            remappings=list(node.remappings.items()),
            output='screen',
            emulate_tty=True,
            respawn=True,
            respawn_delay=1.0,
        )
        for node in live_graph(GraphSettings(**values))
    ]


def generate_launch_description() -> LaunchDescription:
    """Declare an argument for every preset of the graph, then start its nodes."""
    arguments = []
    for field in dataclasses.fields(GraphSettings):
        default = {}
        if field.default is not dataclasses.MISSING:
            default['default_value'] = '' if field.default is None else str(field.default)
        arguments.append(
            DeclareLaunchArgument(field.name, description=field.metadata['description'], **default)
        )
    return LaunchDescription([*arguments, OpaqueFunction(function=nodes)])
