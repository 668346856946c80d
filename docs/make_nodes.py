"""Write docs/nodes.md: the topics, services, actions and parameters of every node.

    python docs/make_nodes.py            # writes docs/nodes.md and what follows from it
    python docs/make_nodes.py --check    # exit status 1 if one of them is out of date

node_parameters.json holds the parameters for the checks of parameter files, porotwin.policy.xml the
rights of every node (make_policy.py).

The tables come from the running nodes: each node is started here, asked for its interfaces, and
ended. tests/test_documents.py runs the check.
"""

import faulthandler
import importlib
import inspect
import json
import os
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import rclpy
from make_policy import KINDS, POLICY, policy
from rclpy.action import ActionServer, get_action_server_names_and_types_by_node
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.subscription import Subscription

from porotwin_core.ros.node import ensure_diagnostics, rules_of
from porotwin_core.ros.parameter_rule import ParameterRule
from porotwin_imaging.sources.source_registry import SOURCES

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / 'docs' / 'nodes.md'
RULES = ROOT / 'porotwin_hub' / 'porotwin_hub' / 'launching' / 'node_parameters.json'
SMALL_RIG = ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml'
NAMESPACE = '/porotwin'

LONGEST_S = 120
"""Time after which the script gives up [s]; it takes about 15 s."""

COARSE = {'grid': '31x19'}
"""Given to every node, so that it starts soon; the page shows the default."""

Rows = list[tuple[str, ...]]
"""Rows of a table."""

HIDDEN_TOPICS = {'/rosout', '/parameter_events'}
HIDDEN_TYPES = ('rcl_interfaces', 'type_description_interfaces')
SHARED_BY = 3
"""Nodes with the same parameter from which on one table describes it."""

HIDDEN_PARAMETERS = {'use_sim_time', 'start_type_description_service'}

HEAD = """\
# Nodes

This page is a reference for ROS developers: all topics, services, actions and parameters of the
nodes. `docs/make_nodes.py` writes it from the running nodes. Names are relative to the namespace
`/porotwin`. `/clock` and `/diagnostics` are global. Units are SI. Every node also has the parameter
`use_sim_time`.

The quality of service of a topic names the depth of its queue. It is reliable unless *best effort*
is named. *Latched* (transient local) means that a late subscriber gets the last messages; otherwise
it gets none. Where two are named, publisher and subscriber differ.
`porotwin_core/porotwin_core/ros/qos.py` gives the reasons. A value in code font is the default of
its parameter.

`./porotwin up` starts all nodes. To start one node alone:

```
.venv/bin/python -m porotwin_solver.solver_node --ros-args -r __ns:=/porotwin \\
    -p rig:=rig.yaml
```
"""


def node_classes() -> list[tuple[str, type[Node]]]:
    """Return the executable and the class of every node of the project."""
    found = []
    for path in sorted(ROOT.glob('porotwin_*/porotwin_*/**/*_node.py')):
        package, *rooms = path.relative_to(ROOT).parent.parts[1:]
        module = importlib.import_module('.'.join([package, *rooms, path.stem]))
        for _, value in inspect.getmembers(module, inspect.isclass):
            if issubclass(value, Node) and value.__module__ == module.__name__:
                found.append((f'{package}/{path.stem}', value))
    return found


def rig_with_camera(folder: Path) -> Path:
    """Write the description of the small rig, with a camera, and return its path."""
    path = folder / 'rig.yaml'
    corners = '[[100, 100], [100, 900], [1500, 900], [1500, 100]]'
    text = SMALL_RIG.read_text(encoding='utf-8')
    path.write_text(f'{text}camera: {{corners_px: {corners}}}\n', encoding='utf-8')
    return path


def absent_pumps(folder: Path) -> Path:
    """Write a file of pumps on a line that does not exist, and return its path."""
    wells = ('injector', 'producer', 'control1', 'control2', 'control3')
    entry = 'protocol: new_era, port: /dev/absent, diameter_mm: 20, max_rate_ml_h: 1000'
    path = folder / 'pumps.yaml'
    lines = [f'  {well}: {{{entry}, address: {n}}}' for n, well in enumerate(wells)]
    path.write_text('\n'.join(['pumps:', *lines, '']), encoding='utf-8')
    return path


def needed_parameters(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters without which a node does not start, by executable."""
    rig = {'rig': str(rig_with_camera(folder))}
    photos = ROOT / 'docs' / 'pictures'
    return {
        'porotwin_costa/trainer_node': {**rig, 'dataset': str(folder / 'pairs')},
        'porotwin_diagnosis/diagnosis_node': {**rig, 'output': str(folder / 'diagnoses')},
        'porotwin_imaging/camera_node': {'source': f'folder:{photos}'},
        'porotwin_pumps/pumps_node': {**rig, 'pumps': str(absent_pumps(folder))},
        'porotwin_rig/mock_camera_node': {'photos': str(photos)},
        'porotwin_page/page_node': {'address': '127.0.0.1:0'},
        'porotwin_recording/player_node': {'bag': str(ROOT / 'bags' / 'sample')},
        'porotwin_recording/recorder_node': {'output': str(folder / 'bag')},
        'default': rig,
    }


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """Return a Markdown table, or nothing if it has no rows."""
    lines = ['| ' + ' | '.join(cell or ' ' for cell in row) + ' |' for row in rows]
    if not lines:
        return ''
    rule = '|' + ' --- |' * len(head)
    return '\n'.join(['| ' + ' | '.join(head) + ' |', rule, *lines, ''])


def short(name: str) -> str:
    """Return a name relative to the namespace of the graph."""
    return name.removeprefix(NAMESPACE + '/')


def quality(end: Publisher | Subscription) -> str:
    """Return the reliability, depth and durability of a publisher or subscriber, in words."""
    profile = end.qos_profile
    late = ', latched' if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL else ''
    best = '' if profile.reliability == ReliabilityPolicy.RELIABLE else 'best effort, '
    return f'{best}depth {profile.depth}{late}'


def interfaces(node: Node) -> Rows:
    """Return kind, name, type and quality of all that `node` publishes, subscribes to and offers.

    Raw subscriptions follow the topics that are there, such as those of the recorder.
    """
    subscriptions = (item for item in node.subscriptions if not item.raw)
    topics = [
        *(('Publishes', item.topic_name, item.msg_type, quality(item)) for item in node.publishers),
        *(
            ('Subscribes to', item.topic_name, item.msg_type, quality(item))
            for item in subscriptions
        ),
    ]
    services = [('Services', item.service_name, item.srv_type, '') for item in node.services]
    rows = [
        (kind, short(name), kind_of(message), quality)
        for kind, name, message, quality in (*topics, *services)
        if name not in HIDDEN_TOPICS and not message.__module__.startswith(HIDDEN_TYPES)
    ]
    return sorted({*rows, *actions(node)})


def actions(node: Node) -> Rows:
    """Return the rows of the actions that `node` offers; it discovers them in a moment."""
    offered = sum(isinstance(one, ActionServer) for one in node.waitables)
    found: Sequence[tuple[str, list[str]]] = ()
    while len(found) < offered:
        name, namespace = node.get_name(), node.get_namespace()
        found = get_action_server_names_and_types_by_node(node, name, namespace)
    return [
        ('Actions', short(name), types[0].replace('/action/', '/'), '') for name, types in found
    ]


def kind_of(message: Any) -> str:
    """Return the type of a topic, service or action, such as `porotwin_msgs/NewState`."""
    return f'{message.__module__.split(".")[0]}/{message.__name__}'


def parameters(node: Node) -> Rows:
    """Return name, type with default and allowed values, and description of every parameter."""
    names = sorted(set(node.list_parameters([], 0).names) - HIDDEN_PARAMETERS)
    defaults = {rule.name: rule.default for rule in rules_of(node) if rule.name in COARSE}
    rows: Rows = []
    for name in names:
        descriptor = node.describe_parameter(name)
        value = defaults.get(name, node.get_parameter(name).value)
        kind = Parameter.Type(descriptor.type).name.lower()
        default = '' if value in ('', None) else f'`{value}`'
        if '/' in default and name != 'topics':
            default = 'needed'
        allowed = descriptor.additional_constraints
        values = ', '.join(filter(None, (kind, default, allowed)))
        rows.append((f'`{name}`', values, descriptor.description))
    return rows


def rules(node: Node) -> dict[str, Any]:
    """Return the rules of all parameters of `node`; the camera has those of all its sources."""
    found = {rule.name: rule for rule in rules_of(node)}
    if node.get_name() == 'camera':
        options = [option for kind in SOURCES.values() for option in kind.options]
        for option in options:
            values = {key: value for key, value in vars(option).items() if value is not None}
            found.setdefault(option.name, ParameterRule(**values))
    return {name: found[name].as_json() for name in sorted(found)}


def named(kind: str, ends: Rows) -> str:
    """Return the line of a node with its topics, services or actions of one kind."""
    names = [f'`{name}`' for end, name, *_ in ends if end == kind]
    return f'- {kind}: {", ".join(names)}' if names else ''


def interface_table(ends: Rows) -> str:
    """Return the table of all topics, services and actions, once each."""
    qualities: dict[tuple[str, str], list[str]] = {}
    for _, name, message, quality in sorted(ends):
        known = qualities.setdefault((name, message), [])
        if quality not in known:
            known.append(quality)
    rows = ((f'`{name}`', kind, ' or '.join(known)) for (name, kind), known in qualities.items())
    return table(('name', 'type', 'quality of service'), sorted(rows))


def section(executable: str, node: Node, ends: Rows, values: Rows, shared: Rows) -> str:
    """Return the Markdown section of one node, which only names the `shared` parameters."""
    summary = (inspect.getdoc(type(node)) or '').split('\n\n')[0].replace('\n', ' ')
    package, module = executable.split('/')
    own = [row for row in values if row not in shared]
    others = ', '.join(row[0] for row in values if row in shared)
    parts = [
        f'## {node.get_name()}\n\n{summary}\n\nPackage `{package}`, executable `{module}`.\n',
        '\n'.join(filter(None, (named(kind, ends) for kind in KINDS))) + '\n',
        table(('parameter', 'values', 'meaning'), own),
        f'Shared parameters: {others}.\n' if others else '',
    ]
    return '\n'.join(filter(None, parts))


def started(make: type[Node], given: dict[str, Any]) -> Node:
    """Return a node as it is after its start; some end soon."""
    overrides = [Parameter(name, value=value) for name, value in {**COARSE, **given}.items()]
    context = Context()  # its own: a node that has finished shuts its context down
    rclpy.init(context=context)
    node = make(namespace=NAMESPACE, parameter_overrides=overrides, context=context)
    ensure_diagnostics(node)
    return node


def documents() -> dict[Path, str]:
    """Return the texts of all files."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    with tempfile.TemporaryDirectory() as folder:
        needed = needed_parameters(Path(folder))
        nodes = []
        for executable, make in node_classes():
            node = started(make, needed.get(executable, needed['default']))
            nodes.append((executable, node, interfaces(node), parameters(node)))
        all_rules = {node.get_name(): rules(node) for _, node, *_ in nodes}
    counts = Counter(row for *_, values in nodes for row in values)
    shared = sorted(row for row, count in counts.items() if count >= SHARED_BY)
    sections = [section(*node, shared) for node in nodes]
    page = '\n'.join(
        [
            HEAD,
            interface_table([end for _, _, ends, _ in nodes for end in ends]),
            table(('shared parameter', 'values', 'meaning'), shared),
            *sections,
        ]
    )
    return {
        PAGE: page,
        POLICY: policy(page),
        RULES: json.dumps(all_rules, indent=1, sort_keys=True) + '\n',
    }


def main() -> int:
    """Write the files, or with --check compare them."""
    texts = documents()
    if '--check' in sys.argv[1:]:
        return int(any(path.read_text(encoding='utf-8') != text for path, text in texts.items()))
    for path, text in texts.items():
        path.write_text(text, encoding='utf-8')
    return 0


if __name__ == '__main__':
    faulthandler.dump_traceback_later(LONGEST_S, exit=True)
    try:
        status = main()
    except BaseException:
        traceback.print_exc()
        status = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # threads of the nodes wait for a graph that never comes
