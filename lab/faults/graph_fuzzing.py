"""Random words to a running graph: its topics, services and parameters, and its page.

A stranger's node and a stranger's browser send what nobody wrote a test for. The graph may refuse
or ignore it. It is a fault when a node ends, when a node writes a traceback, when a setpoint leaves
the limits of the rig, when the page fails, or when control does not come back in the silence that
follows.
"""

import contextlib
import copy
import http.client
import importlib
import json
import math
import random
import re
import tempfile
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import ListParameters, SetParameters
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from lab.faults.endurance import STALL_S, LongRun, long_run
from lab.faults.fuzzing import WORDS, FuzzResult, damaged
from porotwin_cli.running.live_node import listening, live_node
from porotwin_cli.terminal import WorkFailed
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.units import MINUTE_S
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S
from porotwin_core.rig import load_rig
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.node import LEFT_OUT
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_msgs.msg import Setpoint

HOURS = 1000.0
"""Simulated time [h]: longer than any fuzz run."""

PER_BATCH = 20
"""Words between two looks at the graph."""

WORD_LENGTH = 160
"""Longest part of a word that a fault quotes [characters]."""

FORGED = 'forged by a stranger'
"""Reason in a setpoint that the stranger publishes."""

ANSWER_S = 10.0
"""Longest wait for an answer of the page [s]."""

CALL_S, POLL_S = 1.0, 0.01
"""Longest wait for a service, and time between two looks for its answer [s]."""

MOST_ITEMS = 4
"""Most items of a list in a message."""

LONG = 100_000
"""Length of a long text [characters]."""

SERVER_FAILS, UNAVAILABLE = 500, (501, 503)
"""Least HTTP status of a page that fails; those that only tell that something is not there."""

STRANGE_NUMBERS = (math.nan, math.inf, -math.inf, -1.0, 0.0, 1e-300, 1e300, 1e18, -0.0)
STRANGE_TEXTS = (
    *(word.decode(errors='replace') for word in WORDS), '/dev/zero', '../../etc/passwd', 'injector',
    '\x1b[2J\x1b[H', 'control1', '<script>1</script>', 'x' * LONG,
)  # fmt: skip

PATHS = (
    '/', '/events', '/past?state=1', '/rigs', '/report', '/map/observed.png', '/map/x.png?theme=y',
    '/values/observed', '/scale/observed.png', '/confirm', '/what-if', '/mend', '/web/page.js',
    '/panels/../../etc/passwd',
)  # fmt: skip
BODIES = (
    {'sequence': 1, 'rates_ml_h': {'injector': 500.0, 'control1': 1.0}},
    {'rates_ml_h': {'control1': 1e9, 'control2': -3.0}},
    {'sequence': 1, 'accept': True},
)


@dataclass
class Stranger:
    """Makes random messages; those that the graph sent serve as examples.

    Attributes:
        draw: the random numbers.
        seen: the last message of each type that came over the graph.
    """

    draw: random.Random
    seen: dict[type, Any] = field(default_factory=dict)

    def message(self, kind: type) -> Any:
        """Return a message: a damaged copy of one that was seen, or a random one."""
        example = self.seen.get(kind)
        if example is None or self.draw.random() < 0.3:
            return self._filled(kind())
        result = copy.deepcopy(example)
        for _ in range(self.draw.randint(0, 2)):
            self._damage(result)
        return result

    def _filled(self, message: Any) -> Any:
        """Give every field of `message` a random value."""
        for name, slot in zip(message.get_fields_and_field_types(), _slots(message), strict=True):
            setattr(message, name, self.value(slot))
        return message

    def _damage(self, message: Any) -> None:
        """Give one field of `message`, or of a message in it, another value."""
        names = list(message.get_fields_and_field_types())
        place = self.draw.randrange(len(names))
        old = getattr(message, names[place])
        if hasattr(old, 'get_fields_and_field_types'):
            self._damage(old)
        elif isinstance(old, list) and old and hasattr(old[0], 'get_fields_and_field_types'):
            self._damage(self.draw.choice(old))
        else:
            setattr(message, names[place], self.value(_slots(message)[place]))

    def value(self, slot: Any) -> Any:
        """Return a random value of the type `slot` of `rosidl_parser`."""
        kind = type(slot).__name__
        if kind == 'BasicType':
            return self._number(slot.typename)
        if kind in ('UnboundedString', 'BoundedString'):
            return self.draw.choice(STRANGE_TEXTS)
        if kind == 'NamespacedType':
            return self.message(_class('.'.join(slot.namespaces), slot.name))
        most = min(MOST_ITEMS, getattr(slot, 'maximum_size', MOST_ITEMS))
        size = getattr(slot, 'size', None) or self.draw.randint(0, most)
        items = [self.value(slot.value_type) for _ in range(size)]
        is_bytes = getattr(slot.value_type, 'typename', '') == 'octet'
        return items if not is_bytes else [bytes([self.draw.randrange(256)]) for _ in items]

    def _number(self, typename: str) -> Any:
        if typename == 'boolean':
            return self.draw.random() < 0.5
        if typename in ('float', 'double'):
            value = self.draw.choice((*STRANGE_NUMBERS, self.draw.uniform(-1.0, 1.0)))
            return value if typename == 'double' or abs(value) < 1e38 else math.inf
        if typename == 'octet':
            return bytes([self.draw.randrange(256)])
        unsigned, bits = typename.startswith('uint'), int(re.sub(r'\D', '', typename) or 8)
        low, high = (0, 2**bits - 1) if unsigned else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return self.draw.choice((low, high, 0, 1, self.draw.randint(low, high)))


def _slots(message: Any) -> tuple[Any, ...]:
    return tuple(type(message).SLOT_TYPES)


def _class(module: str, name: str) -> type:
    """Return a class of interfaces; a part of an action, such as `Train_Goal`, belongs to it."""
    found: Any = importlib.import_module(module)
    for part in name.split('_'):
        found = getattr(found, part)
    return found


def _service_class(ros_name: str) -> Any:
    """Return the class of a service, also of one of the three of an action."""
    found = re.fullmatch(r'(.*/action/.*)_(SendGoal|GetResult)', ros_name)
    if found is None:
        return _class_of(ros_name)
    action: Any = _class_of(found[1])
    return getattr(action.Impl, f'{found[2]}Service')


def _class_of(ros_name: str) -> type:
    """Return the class of a name such as `std_msgs/msg/Header`."""
    package, kind, name = ros_name.split('/')
    return _class(f'{package}.{kind}', name)


class GraphFuzz:
    """A stranger's node and browser beside a running twin; see `fuzz_graph`."""

    def __init__(
        self, run: LongRun, ear: Node, mouth: Node, draw: random.Random, outcome: FuzzResult
    ) -> None:
        """Begin to listen.

        Args:
            run: the twin.
            ear: a node whose callbacks are called.
            mouth: a node that nobody else spins, so that its publishers may go at any time.
            draw: the random numbers.
            outcome: receives the faults.
        """
        self.outcome = outcome
        self._run, self._node, self._draw = run, mouth, draw
        self._executor = SingleThreadedExecutor(context=mouth.context)
        self._executor.add_node(mouth)
        self._limits = Limits.of(load_rig(small_rig()))
        self._stranger = Stranger(draw)
        self._open: list[Callable[[], object]] = []
        self._looked: dict[str, int] = {}
        self._pids = {name: run.processes.process(name).pid for name in run.nodes}
        self._words: list[str] = []
        self._quoted = False
        self._page = _page_address(run)
        _await_discovery(mouth, set(run.nodes))
        for topic, kind in self._topics().items():
            ear.create_subscription(kind, topic, self._see, qos.FIELD)

    def _topics(self) -> dict[str, type]:
        """Return the types of the graph's topics."""
        return {
            topic: _class_of(types[0])
            for topic, types in self._node.get_topic_names_and_types()
            if (topic.startswith(NAMESPACE) and '/_action/' not in topic)
            or topic in ('/diagnostics', '/clock')
        }

    def _see(self, message: Any) -> None:
        """Keep a message as an example; check the setpoints of the twin."""
        if isinstance(message, Setpoint):
            if message.reason == FORGED:
                return
            violations = self._limits.violations(conversions.rates_from_msg(message.wells))
            if violations:
                self._fault(f'a setpoint outside the limits: {violations}')
        self._stranger.seen[type(message)] = message

    def _fault(self, text: str) -> None:
        """Keep a fault; the first one of a batch with the words before it."""
        words = [] if self._quoted else self._words
        self._quoted = True
        self.outcome.faults.append(' | '.join([text, *words]))

    def batch(self) -> None:
        """Say some words to the graph, become silent, and look whether the graph goes on."""
        self._words, self._quoted = [], False
        for _ in range(PER_BATCH):
            speak = self._draw.choice((self._publish, self._call, self._set, self._browse))
            speak()
        for close in self._open:
            close()
        self._open = []
        self._look()

    def _publish(self) -> None:
        topic, kind = self._draw.choice(sorted(self._topics().items(), key=str))
        publisher = self._node.create_publisher(kind, topic, qos.CONFIG)
        self._open.append(partial(self._node.destroy_publisher, publisher))
        message = self._stranger.message(kind)
        if isinstance(message, Setpoint):
            message.reason = FORGED
        self._words.append(f'topic {topic}: {str(message)[:WORD_LENGTH]}')
        with contextlib.suppress(RCLError):  # the library refuses to send it
            publisher.publish(message)

    def _call(self) -> None:
        names = self._node.get_service_names_and_types()
        name, types = self._draw.choice([item for item in names if item[0].startswith(NAMESPACE)])
        kind = _service_class(types[0])
        request = self._stranger.message(kind.Request)
        self._words.append(f'service {name}: {str(request)[:WORD_LENGTH]}')
        self._answer(name, kind, request)

    def _set(self) -> None:
        """Set a parameter that a node has to a random value."""
        name = f'{NAMESPACE}/{self._draw.choice(self._run.nodes)}'
        listed = self._answer(f'{name}/list_parameters', ListParameters, ListParameters.Request())
        if listed is None or not listed.result.names:
            return
        parameter = Parameter(
            name=self._draw.choice(listed.result.names),
            value=self._stranger.message(ParameterValue),
        )
        self._words.append(f'parameter of {name}: {str(parameter)[:WORD_LENGTH]}')
        request = SetParameters.Request(parameters=[parameter])
        self._answer(f'{name}/set_parameters', SetParameters, request)

    def _answer(self, name: str, kind: Any, request: Any) -> Any:
        """Return the answer of a service; None if none comes within `CALL_S`."""
        client = self._node.create_client(kind, name)
        self._open.append(partial(self._node.destroy_client, client))
        if not client.wait_for_service(CALL_S):
            return None
        future = client.call_async(request)
        self._executor.spin_until_future_complete(future, CALL_S)
        return future.result() if future.done() else None

    def _browse(self) -> None:
        """Send a request to the page; it must answer, and not fail."""
        path, body = self._draw.choice(PATHS), json.dumps(self._draw.choice(BODIES)).encode()
        seed = self._draw.randrange(2**31)
        path = damaged(path.encode(), seed).decode('latin-1') if seed % 2 else path
        path = ''.join(c if c.isprintable() and c.isascii() and c != ' ' else '%00' for c in path)
        headers = {'Authorization': f'Bearer {self._page.token}'} if seed % 3 else {}
        if seed % 5 == 0:
            headers['Content-Encoding'], body = 'deflate', zlib.compress(body)
        method = self._draw.choice(('GET', 'POST', 'POST', 'PUT', 'HEAD'))
        self._words.append(f'page {method} {path[:WORD_LENGTH]}')
        try:
            status = self._page.answer(method, '/' + path.lstrip('/'), damaged(body, seed), headers)
        except (OSError, http.client.HTTPException) as error:
            self._fault(f'the page does not answer: {error!r}')
            return
        if status >= SERVER_FAILS and status not in UNAVAILABLE:
            self._fault(f'the page fails: {status}')

    def _look(self) -> None:
        """Wait for a setpoint; look for nodes that ended and for tracebacks."""
        self.outcome.read += PER_BATCH
        interval = 2.0 * USUAL_PHOTO_INTERVAL_S
        if not self._run.wait_until(self._run.time + interval, limit=STALL_S, control=True):
            self._fault(f'no setpoint within {STALL_S:g} s: {self._run.last_remark}')
        for name in self._run.nodes:
            pid = self._run.processes.process(name).pid
            if pid != self._pids[name]:
                self._pids[name] = pid
                self._fault(f'the node {name} ended')
            text = self._run.processes.log(name).read_text(encoding='utf-8', errors='replace')
            for line in text[self._looked.get(name, 0) :].splitlines():
                if 'Traceback' in line or (LEFT_OUT in line and 'parameters' not in line):
                    self._fault(f'log of {name}: {line[:WORD_LENGTH]}')
            self._looked[name] = len(text)


@dataclass(frozen=True)
class _Page:
    """The address of the page, and the token of its operator."""

    host: str
    token: str

    def answer(self, method: str, path: str, body: bytes, headers: dict[str, str]) -> int:
        """Return the status of the answer to a request."""
        connection = http.client.HTTPConnection(self.host, timeout=ANSWER_S)
        with contextlib.closing(connection):
            connection.request(method, path, body=body, headers=headers)
            return connection.getresponse().status


def _await_discovery(node: Node, names: set[str]) -> None:
    """Wait until `node` knows the nodes of these names.

    Raises:
        WorkFailed: it does not get to know them.
    """
    deadline = time.monotonic() + ANSWER_S
    while not names <= set(node.get_node_names()):
        if time.monotonic() > deadline:
            raise WorkFailed(f'nodes that are not seen: {names - set(node.get_node_names())}')
        time.sleep(POLL_S)


def _page_address(run: LongRun) -> _Page:
    found = re.search(
        r'page: http://(\S+)/#token=(\S+)', run.processes.log('page').read_text(encoding='utf-8')
    )
    if found is None:
        raise WorkFailed('the page has not told its address')
    return _Page(*found.groups())


def fuzz_graph(minutes: float, seed: int, tell: Callable[[float], object]) -> FuzzResult:
    """Return the outcome of random words to a running twin.

    Args:
        minutes: wall time of the words [min].
        seed: of the words. Their meaning also depends on what the graph sent before.
        tell: receives the share of the time that is over.

    Raises:
        WorkFailed: the twin does not start.
    """
    outcome = FuzzResult()
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),  # where a node saves a file of a strange name
        long_run(HOURS, seed) as run,
    ):
        ear, mouth = (live_node(name, namespace='/elsewhere') for name in ('ear', 'mouth'))
        with listening(ear):
            fuzz = GraphFuzz(run, ear, mouth, random.Random(seed), outcome)
            begun = time.monotonic()
            while (over := time.monotonic() - begun) < MINUTE_S * minutes:
                fuzz.batch()
                tell(min(1.0, over / (MINUTE_S * minutes)))
    return outcome
