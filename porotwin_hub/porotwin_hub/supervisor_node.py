"""Finds nodes that hang: shows them as stale, and ends them so that they are started again.

The launcher starts a node again that ended: `./porotwin up` and `ros2 launch` alike. If the
launcher itself is killed, this node sees to it that no other node outlives it.
"""

import os
import signal
import time
from datetime import timedelta
from threading import Thread
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterEvent
from rclpy.clock import Clock, ClockType
from rclpy.parameter import parameter_value_to_python

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parent import PARENT, launcher_is_gone
from porotwin_core.basis.units import DAY_S
from porotwin_core.clock.freshness import STALE_AFTER_S
from porotwin_core.clock.stamps import set_ahead
from porotwin_core.ros.foreign_words import FewWords, in_short, said
from porotwin_core.ros.node import (
    DIAGNOSTICS,
    HEARTBEAT_S,
    STALE_AFTER,
    Diagnostics,
    TwinNode,
    declare,
    hardware_id,
    run,
)
from porotwin_core.ros.ros_environment import check_room, check_shared_memory
from porotwin_core.ros.single_instance import EVERY_NODES_TOPIC
from porotwin_hub.launching.liveness import (
    RESTART_AFTER_S,
    START_PATIENCE_S,
    Liveness,
    Silence,
)
from porotwin_hub.launching.node_processes import NodeProcess, await_end, kill, nodes_of, process_of
from porotwin_hub.launching.processes import END_PATIENCE_S

QUEUE_DEPTH = 100
"""Reports of health that wait, and senders whose last error is remembered."""

ALL_REPORT = 'all nodes report'
"""State of a graph in which no node is silent."""

FLOOD = (
    f'{DIAGNOSTICS} is flooded: its own reports of health are lost, and those of others too; no '
    'node counts as silent meanwhile; end the node that sends so many'
)
"""State of a graph in which nobody can tell who is silent."""


class SupervisorNode(TwinNode):
    """Watches the health of all nodes; publishes the state STALE for those that are silent."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters and begin to watch.

        Raises:
            InputError: a parameter is wrong.
        """
        super().__init__('supervisor', **kwargs)
        names = declare(self, 'nodes', '', 'names of the nodes to watch, separated by spaces')
        self._stale_after_s = declare(
            self,
            STALE_AFTER,
            STALE_AFTER_S,
            'a node that is silent for longer is shown as stale [s]',
            at_least=2.0,
            at_most=3600.0,
        )
        self._liveness = Liveness(
            names.split(),
            own=self.get_name(),
            stale_after_s=self._stale_after_s,
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
        self._words = FewWords(_print, known=names.split())
        self._state = ''
        self._errors: dict[tuple[str, str], str] = {}
        """The errors that were told, by the device and name of the sender."""
        self._publisher = self.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)
        self._diagnostics = Diagnostics(self)
        self.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, QUEUE_DEPTH)
        self.create_subscription(
            ParameterEvent, EVERY_NODES_TOPIC, self._on_parameters, QUEUE_DEPTH
        )
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
        sender = (in_short(status.hardware_id), in_short(status.name))
        if status.level != DiagnosticStatus.ERROR:
            self._errors.pop(sender, None)
        elif status.name != self.get_name() and self._errors.get(sender) != (
            words := in_short(status.message)
        ):
            if len(self._errors) >= QUEUE_DEPTH:
                self._errors.pop(next(iter(self._errors)))
            self._errors[sender] = words
            device, name = sender
            if device != hardware_id(self):
                name = f'{device or "another device"}: {name}'
            self._words.tell(name, said(name, status.message))

    def _on_parameters(self, event: ParameterEvent) -> None:
        """Print which parameters of a node were set while it runs: any other node may do that."""
        space, _, name = event.node.rpartition('/')
        if space != self.get_namespace().rstrip('/'):
            return
        for one in event.changed_parameters:
            value = parameter_value_to_python(one.value)
            self._words.tell(
                name, said(name, f'the parameter {one.name} was set to {value} while the node runs')
            )

    def _look(self) -> None:
        self._words.look()
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
        if self._liveness.deaf:
            self._report(FLOOD)
        else:
            names = ', '.join(one.name for one in silent)
            words = [f'silent: {names}'] * bool(silent)
            words += [*_words_about_clock(set_ahead()), *_words_about_room()]
            self._report('; '.join(words) or ALL_REPORT)
        for one in silent:
            if one.hangs:
                self._end(one)

    def _report(self, state: str) -> None:
        if state == self._state:
            return
        self._state = state
        level = DiagnosticStatus.OK if state == ALL_REPORT else DiagnosticStatus.WARN
        self._diagnostics.report(level, state, **{STALE_AFTER: self._stale_after_s})
        if state == FLOOD:
            self.get_logger().warning(state)

    def _end(self, silence: Silence) -> None:
        process = _processes().get(silence.name)
        if process is None:
            return
        line = f'{silence.name} was {silence.message}; killed, to be started again'
        _print(line)
        told = {STALE_AFTER: self._stale_after_s}
        self._diagnostics.report(DiagnosticStatus.ERROR, line, **told)
        try:
            kill(process.pid)
        except PermissionError as error:
            self.get_logger().error(f'{silence.name} cannot be killed: {error}')


def _words_about_clock(ahead_s: int) -> list[str]:
    """Return a line if this machine's clock was set while the graph runs, by `ahead_s` [s]."""
    way = 'ahead' if ahead_s > 0 else 'back'
    line = (
        f'the clock of this machine was set {way} by {timedelta(seconds=abs(ahead_s))} (h:mm:ss); '
        'ages and waits go on by a clock that nobody sets; start the twin again after the '
        'experiment'
    )
    return [line] if ahead_s else []


def _words_about_room() -> list[str]:
    """Return a line if a node that starts again would not fit into shared memory or domain."""
    try:
        check_shared_memory()
        check_room(os.environ)
    except InputError as error:
        return [f'no node can start again: {error}']
    return []


def _print(line: str) -> None:
    print(line, flush=True)


def _processes() -> dict[str, NodeProcess]:
    """Return the processes of the nodes with the launcher of this process."""
    launcher = os.environ.get(PARENT)
    return nodes_of(launcher) if launcher is not None else {}


def _launcher_has_ended() -> bool:
    """Return whether the launcher ended.

    A killed launcher with several threads remains the parent until its last thread has ended. It
    is a zombie meanwhile.
    """
    named = PARENT in os.environ  # others end their nodes themselves
    return named and (launcher_is_gone() or process_of(os.getppid()) is None)


def end_orphans() -> None:
    """Wait for the end of the launcher, then see to it that no node outlives it.

    Linux has asked the nodes to end. One may hang in the middleware, this one too.
    """
    while not _launcher_has_ended():
        time.sleep(HEARTBEAT_S)
    others = [one.pid for one in _processes().values() if one.pid != os.getpid()]
    await_end(others, patience_s=END_PATIENCE_S)
    os.kill(os.getpid(), signal.SIGKILL)


def main() -> None:
    """Run the node; after the launcher is gone, no node outlives this function."""
    watch = Thread(target=end_orphans, daemon=True)
    watch.start()
    run(SupervisorNode, threads=1)
    if _launcher_has_ended():
        watch.join()


if __name__ == '__main__':
    main()
