"""Parameter files of ROS 2: read, checked before any node starts, and given to the nodes.

    /porotwin/hub:
      ros__parameters:
        horizon_s: 900.0

The file `node_parameters.json` in this package holds the parameters of all nodes. It is written by
`docs/make_nodes.py` from the running nodes.
"""

import dataclasses
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.likely_name import did_you_mean
from porotwin_core.ros.parameter_rule import ParameterRule
from porotwin_hub.launching.node_description import NAMESPACE, NodeDescription

Rules = Mapping[str, Mapping[str, ParameterRule]]
"""The rules of all parameters by node and name."""

NETWORK = 'network'
"""Section of a parameter file that is not of a node; see `network.py`."""

KEY = 'ros__parameters'
"""Key of the parameters of a node in a parameter file."""

OF_ROS = ('qos_overrides.', 'start_type_description_service')
"""Beginnings of the parameters that ROS itself gives a node, as `ros2 param dump` writes them."""

SHARED = {
    'rig': '--rig',
    'grid': '--grid',
    'preset': '--preset',
    'photo_interval_s': '--photo-interval-s',
    'use_sim_time': '--replay',
}
"""Parameters that all nodes must have alike, and the options of `./porotwin up` that set them."""

HEAD = f"""\
# Parameters of all nodes with their defaults. Use it with ./porotwin up --params FILE.
# Keep the lines to change and remove the others. Values that are commented out are set by the
# options of the command. The form is the one of ROS 2. A node may also be named by its name alone,
# and /** or {NAMESPACE}/* name several nodes.
"""


def known_rules() -> dict[str, dict[str, ParameterRule]]:
    """Return the rules of all parameters of all nodes, by node and name."""
    text = (
        files('porotwin_hub.launching').joinpath('node_parameters.json').read_text(encoding='utf-8')
    )
    return {
        node: {name: ParameterRule.from_json(name, rule) for name, rule in rules.items()}
        for node, rules in json.loads(text).items()
    }


def template(rules: Rules, given: Mapping[str, Iterable[str]]) -> str:
    """Return a parameter file with the defaults of all parameters and their descriptions.

    Args:
        rules: rules of the nodes to show.
        given: names of parameters that the graph sets by itself, by node; they are commented out.
    """
    lines = [HEAD]
    for node, parameters in rules.items():
        lines += [f'{NAMESPACE}/{node}:', f'  {KEY}:']
        own = {*SHARED, *given.get(node, ())}
        if own >= parameters.keys():
            lines[-1] += ' {}'
        for name, rule in parameters.items():
            constraint = f' ({rule.constraint})' if rule.constraint else ''
            value = yaml.safe_dump({name: rule.default}, default_flow_style=False).strip()
            lines.append(f'    # {rule.description}{constraint}')
            lines.append(f'    {"# " if name in own else ""}{value}')
        lines.append('')
    return '\n'.join(lines)


def with_parameters(
    nodes: Sequence[NodeDescription], path: Path, rules: Rules
) -> list[NodeDescription]:
    """Return `nodes` with the parameters of the file `path`, which has the last word.

    Entries of nodes that are known but do not run are checked and not used.

    Raises:
        InputError: one line with the file, and the node or parameter that is unknown, of the wrong
            type, out of range, or set by an option of the command.
    """
    running = {node.name: node for node in nodes}
    namespace = nodes[0].namespace if nodes else NAMESPACE
    taken: dict[str, dict[str, Any]] = {name: {} for name in rules}
    content = read_parameter_file(path)
    try:
        for pattern, parameters in _entries(content):
            matched = _matched(pattern, rules, namespace)
            for name, value in parameters.items():
                if name.startswith(OF_ROS):
                    continue
                for node in _nodes_with(name, pattern, matched, rules):
                    if name in SHARED:
                        default = rules[node][name].default if name in rules[node] else False
                        _refuse_difference(running.get(node), name, value, default)
                    else:
                        taken[node][name] = rules[node][name].taken(value, node)
    except InputError as error:
        raise InputError(f'{path}: {error}') from None
    return [
        dataclasses.replace(node, parameters={**node.parameters, **taken.get(node.name, {})})
        for node in nodes
    ]


def read_parameter_file(path: Path) -> Any:
    """Return the content of a parameter file.

    Raises:
        InputError: it cannot be read.
    """
    from porotwin_core.rig.yaml_reader import read_yaml_file  # brings large packages

    return read_yaml_file(path, remedy='./porotwin up --params-template prints one')


def _entries(content: Any) -> list[tuple[str, dict[str, Any]]]:
    """Return names or patterns of nodes with their parameters, the most general ones first."""
    if isinstance(content, dict):
        content = {key: value for key, value in content.items() if key != NETWORK}
    found = list(_sections('', content or {}))
    return sorted(found, key=lambda entry: ('*' not in entry[0], '**' not in entry[0]))


def _sections(name: str, content: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    if not isinstance(content, dict):
        raise InputError(f"'{name or 'the file'}' is no section; write NODE: {{{KEY}: {{...}}}}")
    for key, value in content.items():
        if key != KEY:
            yield from _sections(f'{name}/{str(key).strip("/")}', value)
        elif not name:
            raise InputError(f'{KEY} stands without a node; write NODE: {{{KEY}: {{...}}}}')
        elif isinstance(value, dict | None):
            yield name, dict(_flat('', value or {}))
        else:
            raise InputError(f"{KEY} of '{name}' is no section; write NAME: VALUE below it")


def _flat(prefix: str, content: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    """Return the parameters of a section; inner sections add their name and a point."""
    for key, value in content.items():
        if isinstance(value, dict):
            yield from _flat(f'{prefix}{key}.', value)
        else:
            yield f'{prefix}{key}', value


def _matched(pattern: str, rules: Rules, namespace: str) -> list[str]:
    """Return the names of the nodes that a name or pattern of a parameter file means."""
    expression = re.escape(pattern).replace(r'/\*\*', r'(/[^/]+)*').replace(r'\*', r'[^/]+')
    full = re.compile(expression)
    found = [node for node in rules if full.fullmatch(f'{namespace}/{node}')]
    found = found or [node for node in rules if full.fullmatch(f'/{node}')]
    if not found:
        short = pattern.removeprefix(namespace).strip('/')
        raise InputError(f"no node is named '{short}'; {_hint(short, rules)}")
    return found


def _nodes_with(name: str, pattern: str, matched: list[str], rules: Rules) -> list[str]:
    """Return the `matched` nodes with a parameter; every node has `use_sim_time`."""
    found = [node for node in matched if name in rules[node] or name == 'use_sim_time']
    if not found:
        who = matched[0] if len(matched) == 1 else f"any node of '{pattern}'"
        known = {each for node in matched for each in rules[node]}
        raise InputError(f"'{name}' is no parameter of {who}; {_hint(name, known)}")
    return found


def _hint(name: str, known: Iterable[str]) -> str:
    return did_you_mean(name, known) or f'known: {", ".join(sorted(known))}'


def _refuse_difference(node: NodeDescription | None, name: str, value: Any, default: Any) -> None:
    if node is not None and node.parameters.get(name, default) != value:
        raise InputError(
            f"'{name}' of {node.name} must be the same for all nodes; set it by the option "
            f'{SHARED[name]}'
        )
