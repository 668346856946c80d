"""Shared parts of all nodes: parameters, diagnostics, and a main loop that ends cleanly."""

import math
import os
import signal
import sys
import time
import traceback
from _thread import interrupt_main
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial, wraps
from pathlib import Path
from threading import Event, Thread
from types import FrameType
from typing import Any, NoReturn
from weakref import WeakKeyDictionary

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.exceptions import InvalidParameterTypeException, NotInitializedException
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock as ClockMessage

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.heap import share_heap
from porotwin_core.basis.parent import REFUSAL, WRONG_PARAMETERS, end_with_parent
from porotwin_core.basis.plain_text import show_all_characters
from porotwin_core.clock.periods import END_S, HEARTBEAT_S
from porotwin_core.clock.photo_interval import (
    LONGEST_PHOTO_INTERVAL_S,
    SHORTEST_PHOTO_INTERVAL_S,
    USUAL_PHOTO_INTERVAL_S,
)
from porotwin_core.clock.stamps import steady_time
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig, load_rig
from porotwin_core.rig.grid_oddities import chosen_grid
from porotwin_core.ros.foreign_words import FewWords
from porotwin_core.ros.node_health import NodeHealth
from porotwin_core.ros.parameter_rule import LARGEST_WHOLE, ParameterRule
from porotwin_core.ros.plain_log import PlainLogger
from porotwin_core.ros.ros_environment import (
    check_environment,
    check_keys,
    check_room,
    check_shared_memory,
    leave_shared_memory,
)
from porotwin_core.ros.senders import LEASE_S, hearers, is_simulated

DIAGNOSTICS = '/diagnostics'
"""Topic of the health of all nodes."""

HEARD_BY = 'heard_by'
"""Value in the diagnostics of a node that others wait for: the nodes that hear it, by name."""

ENDED = 'ended'
"""Value in the last diagnostics of a node that leaves because its work is over."""

STALE_AFTER = 'stale_after_s'
"""Parameter of the supervisor, and value in its diagnostics: longest silence that is none [s]."""

REPORT_S = 60.0
"""Shortest time between two lines about the same doubt [s]."""

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""Signals that ask a node to stop."""

OnChangeFn = Callable[[Any], None]
"""Takes a value of a parameter; raises InputError if it is wrong."""

CLOCK = 'use_sim_time'
"""Parameter of every node of ROS 2: whether the topic /clock sets its time."""


LEFT_OUT = 'left out, it makes this node fail'
"""Words of the log about a message or request that a callback could not take."""


class TwinNode(Node):
    """A node of the graph that no word of another node ends.

    Its log is plain. Nobody gives it another clock while it runs. A message or a request that makes
    a callback fail is left out; rclpy would end the node, and its own callbacks for parameters fail
    at a type that does not exist.
    """

    def __init__(self, name: str, **kwargs: Any) -> None:
        """Make a node called `name`; rclpy takes the `kwargs`, such as `context`."""
        super().__init__(name, **kwargs)
        self._logger = PlainLogger(super().get_logger().name)
        self._left_out = FewWords(self._logger.error)
        self.add_on_set_parameters_callback(self._keep_clock)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[..., Any], *args: Any, **kwargs: Any
    ) -> Any:
        """Subscribe to `topic`, as rclpy does; a message that makes `callback` fail is left out."""

        @wraps(callback)
        def surviving(*words: Any) -> Any:
            try:
                _check_clock(words[0])
                return callback(*words)
            except Exception as error:
                self._tell_left_out(topic, error)

        return super().create_subscription(msg_type, topic, surviving, *args, **kwargs)

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[..., Any], **kwargs: Any
    ) -> Any:
        """Offer a service, as rclpy does; if `callback` fails, the answer is an empty response."""

        @wraps(callback)
        def surviving(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                self._tell_left_out(srv_name, error)
                return type(response)()

        return super().create_service(srv_type, srv_name, surviving, **kwargs)

    def _tell_left_out(self, name: str, error: Exception) -> None:
        if not self.context.ok():
            raise error  # the end of the node, not a word of another
        if isinstance(error, InputError):
            self._left_out.tell(name, f'{name} ignored: {error}')
            return
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f'{place.name}, line {place.lineno} of {Path(place.filename).name}'
        self._left_out.tell(name, f'{name}: {LEFT_OUT}: {error!r} in {where}')

    @property
    def simulated(self) -> bool:
        """Whether the node was started for simulated time."""
        return is_simulated(self)

    def now(self) -> float:
        """Return the time [s] for ages and waits: simulated time, or a clock that nobody sets.

        Simulated time is 0 before it has begun.
        """
        if not self.simulated:
            return steady_time()
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _keep_clock(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse another clock: any node could publish it, and no age would be right any more."""
        other = any(one.name == CLOCK and one.value != self.simulated for one in parameters)
        reason = f"parameter '{CLOCK}' of {self.get_name()} holds while it runs; start it anew"
        return SetParametersResult(successful=not other, reason=reason if other else '')


def _check_clock(message: Any) -> None:
    """Check a message of /clock, which rclpy takes before any node of ours does.

    Raises:
        InputError: its time is negative.
    """
    if isinstance(message, ClockMessage) and message.clock.sec < 0:
        raise InputError(
            f'simulated time {message.clock.sec} s; times begin at 0, so end the node that '
            'publishes this one'
        )


def declare(
    node: Node,
    name: str,
    default: Any,
    description: str,
    *,
    at_least: float = -math.inf,
    at_most: float = math.inf,
    choices: Collection[str] = (),
    on_change: OnChangeFn | None = None,
) -> Any:
    """Declare a parameter and return its value, which has the type of `default`.

    Args:
        node: the node.
        name: name of the parameter, with its unit.
        default: value if none is given.
        description: one line for people.
        at_least: smallest value of a number.
        at_most: largest value of a number.
        choices: the allowed texts; empty: any.
        on_change: takes a new value while the node runs; None: the parameter is read-only. It
            raises InputError to refuse the value.

    Raises:
        InputError: the value given is of another type, not a number, out of range or no choice.
    """

    rule = ParameterRule(
        name, default, description, at_least, at_most, tuple(choices), on_change is not None
    )
    _rules.setdefault(node, []).append(rule)
    try:
        value = node.declare_parameter(name, default).value
    except InvalidParameterTypeException as error:
        raise InputError(f"parameter '{name}' of {node.get_name()}: {error}") from None
    rule.check(value, node.get_name())
    # only now, because rclpy refuses a value by its descriptor in words of its own
    node.set_descriptor(name, _descriptor(rule, node.describe_parameter(name).type))
    if on_change is not None:
        if node not in _handlers:
            _handlers[node] = {}
            node.add_on_set_parameters_callback(partial(_on_set, node))
        _handlers[node][name] = on_change
    return value


def _descriptor(rule: ParameterRule, kind: int) -> ParameterDescriptor:
    """Return the rule of a parameter as ROS 2 knows it, with a range that programs read."""
    descriptor = ParameterDescriptor(
        type=kind,
        description=rule.description,
        read_only=not rule.changeable,
        additional_constraints=rule.constraint,
    )
    if rule.constraint and isinstance(rule.default, float):
        most = sys.float_info.max
        low, high = max(float(rule.at_least), -most), min(float(rule.at_most), most)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif rule.constraint and isinstance(rule.default, int):
        low, high = max(rule.at_least, -LARGEST_WHOLE), min(rule.at_most, LARGEST_WHOLE)
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    return descriptor


_rules: WeakKeyDictionary[Node, list[ParameterRule]] = WeakKeyDictionary()

_handlers: WeakKeyDictionary[Node, dict[str, OnChangeFn]] = WeakKeyDictionary()
"""Takes new values of the parameters that can change, by node and name."""


def rules_of(node: Node) -> list[ParameterRule]:
    """Return the rules of all parameters that `node` has declared, in the order of declaration."""
    return list(_rules.get(node, []))


def _on_set(node: Node, parameters: list[Parameter]) -> SetParametersResult:
    """Take new values of several parameters of `node`, all of them or none."""
    rules = {rule.name: rule for rule in rules_of(node)}
    handlers, taken = _handlers[node], list[str]()
    known = [parameter for parameter in parameters if parameter.name in handlers]
    try:
        for parameter in known:
            rules[parameter.name].check(parameter.value, node.get_name())
        for parameter in known:
            handlers[parameter.name](parameter.value)
            taken.append(parameter.name)
    except InputError as error:
        for name in taken:
            handlers[name](node.get_parameter(name).value)
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)


def declare_rig(node: Node) -> Rig:
    """Declare the parameter `rig`, a path of rig.yaml, and return the rig described there.

    Raises:
        InputError: the description is missing or wrong.
    """
    return load_rig(declare(node, 'rig', '', 'path of rig.yaml'))


def declare_grid(node: Node, rig: Rig) -> Grid:
    """Declare the parameter `grid` (columns x rows of the maps) and return that grid over `rig`.

    The default has square cells of about 5 mm.

    Raises:
        InputError: the parameter is not of the form 187x112, or the grid cannot be computed.
    """
    text = declare(node, 'grid', str(rig.default_grid()), 'columns x rows of the maps')
    return chosen_grid(text, rig)


def declare_photo_interval(node: Node, *, also: str = '') -> float:
    """Declare the parameter `photo_interval_s` and return the time between photographs [s].

    Args:
        node: the node.
        also: another consequence in this node, one clause for people.

    Raises:
        InputError: the value is no time that a camera keeps.
    """
    interval: float = declare(
        node,
        'photo_interval_s',
        USUAL_PHOTO_INTERVAL_S,
        'time between photographs [s]' + also,
        at_least=SHORTEST_PHOTO_INTERVAL_S,
        at_most=LONGEST_PHOTO_INTERVAL_S,
    )
    return interval


class Diagnostics:
    """Publishes the health of one node on /diagnostics once a second (REP-107).

    The executor of the node publishes. Silence therefore means a stuck executor or a stopped
    process. A long computation in another thread does not cause silence.
    """

    def __init__(self, node: Node, *, heard: Collection[str] = ()) -> None:
        """Make the publisher of `node` and its heartbeat.

        Args:
            node: the node.
            heard: topics of the node; each heartbeat names the nodes that hear all of them.
        """
        self._node = node
        self._heard = tuple(heard)
        self._health = NodeHealth()
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # also while simulated time stands still
        own = MutuallyExclusiveCallbackGroup()
        node.create_timer(HEARTBEAT_S, self._beat, callback_group=own, clock=steady)
        node.create_timer(HEARTBEAT_S, self._health.callbacks_ran, clock=steady)

    def report(self, level: bytes, message: str, **values: object) -> None:
        """Publish the health of the node; it is repeated until the next report.

        Args:
            level: DiagnosticStatus.OK, WARN or ERROR.
            message: one line.
            values: numbers and texts by name, published as text.
        """
        texts = {name: str(value) for name, value in values.items()}
        self._health.report(level[0], message, texts)
        self._beat()

    def busy(self, what: str, longest_s: float = math.inf) -> AbstractContextManager[None]:
        """Return a context manager that marks a piece of work as in progress.

        Args:
            what: the work in a few words, such as 'state 12'.
            longest_s: the health is an error if the work takes longer [s]; infinite: never.
        """
        return self._health.busy(what, longest_s)

    def _beat(self) -> None:
        health = self._health.now()
        values = dict(health.values)
        if self._heard:
            values[HEARD_BY] = ' '.join(sorted(hearers(self._node, *self._heard)))
        status = DiagnosticStatus(
            level=bytes([health.level]),
            name=self._node.get_name(),
            hardware_id=hardware_id(self._node),
            message=health.message,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)


def hardware_id(node: Node) -> str:
    """Return the name of the rig in the reports of health: the namespace of its nodes.

    Other devices report on the same topic, perhaps under the name of one of our nodes.
    """
    return str(node.get_namespace()).strip('/') or 'porotwin'


def ensure_diagnostics(node: Node) -> None:
    """Publish the health of `node`, unless the node publishes it already."""
    if not any(publisher.topic_name == DIAGNOSTICS for publisher in node.publishers):
        Diagnostics(node)  # its timers keep it alive


@contextmanager
def until_shutdown(context: Context) -> Iterator[None]:
    """Leave the block without an error when `context` is shut down inside it.

    A signal or another thread may shut the context down at any time, also between the executor's
    check of the context and its use. Errors under a valid context are raised.
    """
    try:
        yield
    except ExternalShutdownException:
        pass
    except (RCLError, NotInitializedException):
        if context.ok():
            raise


def _refuse(error: InputError) -> NoReturn:
    print(f'{REFUSAL}{error}', file=sys.stderr)
    sys.exit(WRONG_PARAMETERS)


def run(make_node: Callable[[], Node], *, threads: int = 4) -> None:
    """Spin a node until its process is asked to stop: the `main` of every node.

    Args:
        make_node: makes the node; an InputError ends the process with status 2 and one line.
        threads: threads that run callbacks; one more is added for the health of the node.
    """
    end_with_parent()
    share_heap()
    show_all_characters()
    try:
        check_environment(os.environ)
        check_keys(os.environ, sys.argv)
        check_room(os.environ)
    except InputError as error:
        _refuse(error)
    try:
        check_shared_memory()
    except InputError as error:
        sys.exit(f'not started: {error}')  # with status 1: the launcher tries it again
    leave_shared_memory()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    executor = executor_of(1 if threads == 1 else threads + 1)
    node = None
    with signals_as_interrupts() as asked:
        try:
            with until_shutdown(executor.context), kept_awake(executor, asked) as awake:
                node = make_node()
                ensure_diagnostics(node)
                executor.add_node(node)
                executor.spin()
        except InputError as error:
            _refuse(error)
        except KeyboardInterrupt:
            pass  # asked to stop, perhaps during the start
        finally:
            for one in STOP_SIGNALS:
                signal.signal(one, signal.SIG_IGN)  # the end is not interrupted
            end_in_order(executor, [] if node is None else [node])
    if awake.slept_s:
        sys.exit(
            f'stood still for {awake.slept_s:.0f} s, so that the other nodes have forgotten this '
            'one; it starts anew'
        )  # with status 1: the launcher starts it


@contextmanager
def signals_as_interrupts() -> Iterator[Event]:
    """Raise KeyboardInterrupt at SIGINT and SIGTERM, at most a heartbeat later.

    The yielded event is set by the first of them. rclpy's own handlers end the context at once,
    which `end_in_order` avoids.
    """
    asked = Event()

    def interrupt(_number: int, _frame: FrameType | None) -> NoReturn:
        asked.set()
        raise KeyboardInterrupt

    before = {one: signal.signal(one, interrupt) for one in STOP_SIGNALS}
    try:
        yield asked
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)


@dataclass
class Awake:
    """Findings of `kept_awake`.

    Attributes:
        slept_s: time for which the process stood still until the others forgot it [s]; 0: never.
    """

    slept_s: float = 0.0


@contextmanager
def kept_awake(executor: Executor, asked: Event | None = None) -> Iterator[Awake]:
    """Let `executor` look at its timers once a heartbeat, and the main thread for signals.

    The middleware may wait by the system's clock, for an hour if that is set back by an hour. The
    main thread takes no signals while it waits for messages. Python drops an interrupt that is
    raised inside a destructor, so that it is repeated while `asked` is set.

    A process that stood still for the lease of the middleware never learns the names of the other
    nodes again. It is asked to stop as by a signal.
    """
    ended, awake = Event(), Awake()

    def wake() -> None:
        before = time.monotonic()
        while not ended.wait(HEARTBEAT_S):
            with until_shutdown(executor.context):
                executor.wake()
            gap, before = time.monotonic() - before, time.monotonic()
            if asked is not None and gap > LEASE_S:
                awake.slept_s = gap
                asked.set()
            if asked is not None and asked.is_set():
                interrupt_main()

    thread = Thread(target=wake, daemon=True)
    thread.start()
    try:
        yield awake
    finally:
        ended.set()
        thread.join()


def executor_of(threads: int, context: Context | None = None) -> Executor:
    """Return an executor that runs callbacks in `threads` threads; None: the default context."""
    if threads == 1:
        return SingleThreadedExecutor(context=context)
    return MultiThreadedExecutor(num_threads=threads, context=context)


def end_in_order(executor: Executor, nodes: Iterable[Node], context: Context | None = None) -> None:
    """End the threads of `executor`, then the `nodes`, then their context; None: the default one.

    rclpy may wait forever if a context ends while another thread waits for its messages, or before
    its nodes.
    """
    executor.shutdown(END_S)  # a thread that is left in the middleware aborts the process
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown(context=context)
