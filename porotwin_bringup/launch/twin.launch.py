"""The twin beside a real rig: ros2 launch porotwin_bringup twin.launch.py rig:=... photos:=..."""

import dataclasses
import os
import types
import typing
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from porotwin_core.basis.parent import PARENT, WRONG_PARAMETERS
from porotwin_hub.launching.graph import GraphSettings, description_of, live_graph
from porotwin_hub.launching.processes import RESTART_PAUSE_S


def converted(text: str, hint: object) -> object:
    """Return the text of an argument as the type of its field; empty means None for a path."""
    if isinstance(hint, types.UnionType):
        return Path(text) if text else None
    if hint is bool:
        return text.lower() in ('true', '1', 'yes')
    return typing.cast(type, hint)(text)


def as_it_is(value: object) -> object:
    """Return the value of a parameter such that launch does not read a text as YAML."""
    return ParameterValue(value, value_type=str) if isinstance(value, str) else value


def end_if_refused(event: ProcessExited, _context: LaunchContext) -> list[Shutdown] | None:
    """End the launch if a node refused its parameters: it would refuse them for ever."""
    if event.returncode != WRONG_PARAMETERS:
        return None
    return [Shutdown(reason=f'{event.process_name} refuses its parameters; its line says why')]


def nodes(context: LaunchContext) -> list[Node]:
    """Return the launch actions of all nodes for the arguments in `context`."""
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
            namespace=node.namespace,
            parameters=[{name: as_it_is(value) for name, value in node.parameters.items()}],
            remappings=list(node.remappings.items()),
            # logs go to the screen and launch's own log, so a third copy is not needed
            ros_arguments=[
                '--disable-external-lib-logs',
                '--enclave',
                f'{node.namespace}/{node.name}',  # its rights, see docs/security.md
            ],
            additional_env={PARENT: str(os.getpid())},  # no node outlives this launch
            output='screen',
            emulate_tty=True,
            respawn=True,
            respawn_delay=RESTART_PAUSE_S,
            on_exit=end_if_refused,
        )
        for node in live_graph(GraphSettings(**values))
    ]


def generate_launch_description() -> LaunchDescription:
    """Declare one argument for every option of the graph, then start the nodes."""
    arguments = []
    for field in dataclasses.fields(GraphSettings):
        default = {}
        if field.default is not dataclasses.MISSING:
            default['default_value'] = '' if field.default is None else str(field.default)
        arguments.append(
            DeclareLaunchArgument(field.name, description=description_of(field.name), **default)
        )
    return LaunchDescription([*arguments, OpaqueFunction(function=nodes)])
