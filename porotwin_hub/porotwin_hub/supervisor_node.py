"""Finds nodes that hang: shows them as stale, and ends them so that they are started again.

The launcher starts a node again that ended: `./porotwin up` and `ros2 launch` alike. If the
launcher itself is killed, this node sees to it that no other node outlives it.
"""

import os
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from porotwin_core.basis.parent import PARENT, launcher_is_gone
from porotwin_core.basis.units import DAY_S
from porotwin_core.ros.node import DIAGNOSTICS, HEARTBEAT_S, Diagnostics, declare, hardware_id, run
from porotwin_hub.launching.liveness import (
    RESTART_AFTER_S,
    STALE_AFTER_S,
    START_PATIENCE_S,
    Liveness,
    Silence,
)
from porotwin_hub.launching.node_processes import NodeProcess, await_end, kill, nodes_of, process_of

ORPHAN_PATIENCE_S = 30.0
"""Time for the nodes to end by themselves after their launcher was killed [s]."""


class SupervisorNode(Node):
    """Watches the health of all nodes; publishes the state STALE for those that are silent."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters and begin to watch.

        Raises:
            InputError: a parameter is wrong.
        """
        super().__init__('supervisor', **kwargs)
        names = declare(self, 'nodes', '', 'names of the nodes to watch, separated by spaces')
        self._liveness = Liveness(
            names.split(),
            stale_after_s=declare(
                self,
                'stale_after_s',
                STALE_AFTER_S,
                'a node that is silent for longer is shown as stale [s]',
                at_least=2.0,
                at_most=3600.0,
            ),
            restart_after_s=declare(
                self,
                'restart_after_s',
                RESTART_AFTER_S,
                'a node that is silent for longer is killed and started again [s]; 0: never',
                at_least=0.0,
                at_most=DAY_S,
            ),
            start_patience_s=declare(
                self,
                'start_patience_s',
                START_PATIENCE_S,
                'longest time from the start of a node to its first report [s]',
                at_least=10.0,
                at_most=DAY_S,
            ),
        )
        self._silent: tuple[str, ...] = ()
        self._errors: dict[tuple[str, str], str] = {}
        """The errors that were told, by the device and name of the sender."""
        self._publisher = self.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)
        self._diagnostics = Diagnostics(self)
        self.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 100)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(HEARTBEAT_S, self._look, clock=steady)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.level == DiagnosticStatus.STALE:
                continue
            if status.hardware_id == hardware_id(self):
                self._liveness.heard(status.name)
            self._tell_error(status)

    def _tell_error(self, status: DiagnosticStatus) -> None:
        """Print the error of a node once, for the person who started the graph."""
        sender = (status.hardware_id, status.name)
        if status.level != DiagnosticStatus.ERROR:
            self._errors.pop(sender, None)
        elif status.name != self.get_name() and self._errors.get(sender) != status.message:
            self._errors[sender] = status.message
            print(f'{status.name}: {status.message}', flush=True)

    def _look(self) -> None:
        silent = self._liveness.silent(_processes)
        array = DiagnosticArray(
            status=[
                DiagnosticStatus(
                    level=DiagnosticStatus.STALE,
                    name=one.name,
                    hardware_id=hardware_id(self),
                    message=one.message,
                )
                for one in silent
            ]
        )
        array.header.stamp = self.get_clock().now().to_msg()
        if silent:
            self._publisher.publish(array)
        self._report(tuple(one.name for one in silent))
        for one in silent:
            if one.hangs:
                self._end(one)

    def _report(self, silent: tuple[str, ...]) -> None:
        if silent == self._silent:
            return
        self._silent = silent
        if silent:
            self._diagnostics.report(DiagnosticStatus.WARN, f'silent: {", ".join(silent)}')
        else:
            self._diagnostics.report(DiagnosticStatus.OK, 'all nodes report')

    def _end(self, silence: Silence) -> None:
        process = _processes().get(silence.name)
        if process is None:
            return
        line = f'{silence.name} was {silence.message}; killed, to be started again'
        print(line, flush=True)
        self._diagnostics.report(DiagnosticStatus.ERROR, line)
        try:
            kill(process.pid)
        except PermissionError as error:
            self.get_logger().error(f'{silence.name} cannot be killed: {error}')


def _processes() -> dict[str, NodeProcess]:
    """Return the processes of the nodes with the launcher of this process."""
    launcher = os.environ.get(PARENT)
    return nodes_of(launcher) if launcher is not None else {}


def _launcher_has_ended() -> bool:
    """Return whether the launcher ended.

    A killed launcher with several threads remains the parent until its last thread has ended. It
    is a zombie meanwhile.
    """
    return launcher_is_gone() or process_of(os.getppid()) is None


def end_orphans() -> None:
    """See to it that the other nodes of the launcher end; Linux has asked them already."""
    others = [one.pid for one in _processes().values() if one.pid != os.getpid()]
    await_end(others, patience_s=ORPHAN_PATIENCE_S)


def main() -> None:
    """Run the node; after the launcher is gone, no node outlives this function."""
    run(SupervisorNode, threads=1)
    if _launcher_has_ended():
        end_orphans()


if __name__ == '__main__':
    main()
