"""The security policy of SROS2: which node may publish, subscribe, offer and call what.

docs/make_nodes.py writes it with docs/nodes.md, from the same running nodes. The services that a
node calls are names in its source: in its module, and in those of its package that it imports.
"""

import ast
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

from porotwin_core.ros.senders import goals_of, vouched_by
from porotwin_core.ros.vouching import CALLERS

ROOT = Path(__file__).resolve().parents[1]
POLICY = ROOT / 'porotwin_guard' / 'config' / 'porotwin.policy.xml'
NAMESPACE = '/porotwin'

HEAD = """\
<?xml version="1.0" encoding="UTF-8"?>
<!-- Written by docs/make_nodes.py; docs/security.md says how to use it. -->
"""

COMMON_TOPICS = {'publish': ('/rosout', '/parameter_events'), 'subscribe': ('/clock',)}
"""Topics of every node of ROS 2."""

COMMON_SERVICES = (
    '~/describe_parameters', '~/get_parameter_types', '~/get_parameters', '~/list_parameters',
    '~/set_parameters', '~/set_parameters_atomically', '~/get_type_description',
)  # fmt: skip
"""Services of every node of ROS 2."""

KINDS = {
    'Subscribes to': ('topics', 'subscribe'),
    'Publishes': ('topics', 'publish'),
    'Services': ('services', 'reply'),
    'Actions': ('actions', 'execute'),
}
"""Kinds of interfaces in docs/nodes.md, and what the policy calls them."""

PUBLISH = KINDS['Publishes']
RECORDER = 'recorder'
"""The node that may subscribe to everything."""

OF_WELLS = {'display': ('display/measured_ml_h/*', 'display/setpoint_ml_h/*')}
"""Topics that a node publishes for each well, whose names the rig gives."""

Rights = dict[tuple[str, str], set[str]]
"""Names by element and attribute of the policy, such as ('topics', 'publish')."""


def policy(nodes_page: str) -> str:
    """Return the policy for the nodes of docs/nodes.md."""
    nodes = dict(_nodes(nodes_page))
    offered = {
        name: element
        for rights, _ in nodes.values()
        for (element, attribute), names in rights.items()
        if attribute in ('reply', 'execute')
        for name in names
    }
    for node, topics in OF_WELLS.items():
        nodes[node][0][PUBLISH].update(topics)
    published = set().union(*(rights.get(PUBLISH, set()) for rights, _ in nodes.values()))
    nodes[RECORDER][0].setdefault(('topics', 'subscribe'), set()).update(published)
    root = ET.Element('policy', version='0.2.0')
    enclaves = ET.SubElement(root, 'enclaves')
    for node, (rights, module) in nodes.items():
        words, served = _words(module)
        # a node may offer a service only with some parameters
        rights.setdefault(('services', 'reply'), set()).update(served)
        goals = {goals_of(action) for action in rights.get(('actions', 'execute'), ())}
        served = (rights['services', 'reply'] | goals) & CALLERS.keys()
        heard = {vouched_by(caller) for name in served for caller in CALLERS[name]}
        rights.setdefault(('topics', 'subscribe'), set()).update(heard)
        own = set().union(*rights.values())
        for name in sorted(words & offered.keys() - own):
            call = 'request' if offered[name] == 'services' else 'call'
            rights.setdefault((offered[name], call), set()).add(name)
        _add_enclave(enclaves, node, rights)
    ET.indent(root)
    return HEAD + ET.tostring(root, encoding='unicode') + '\n'


def _nodes(page: str) -> Iterable[tuple[str, tuple[Rights, Path]]]:
    """Yield the name, the rights and the module of every node of the page."""
    for section in page.split('\n## ')[1:]:
        name = section.splitlines()[0].strip()
        package, executable = re.findall(r'Package `(\w+)`, executable `(\w+)`', section)[0]
        rights: Rights = {}
        for kind, names in re.findall(r'^- ([\w ]+): (`.+)$', section, re.M):
            rights[KINDS[kind]] = set(re.findall(r'`(\S+)`', names))
        (module,) = (ROOT / package / package).rglob(f'{executable}.py')
        yield name, (rights, module)


def _words(module: Path) -> tuple[set[str], set[str]]:
    """Return all texts in `module` and its imports from its package, and the services it offers."""
    package, seen, waiting = module.relative_to(ROOT).parts[0], set[Path](), [module]
    words: set[str] = set()
    served: set[str] = set()
    while waiting:
        path = waiting.pop()
        if path in seen or not path.is_file():
            continue
        seen.add(path)
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                words.add(node.value)
            if isinstance(node, ast.Call) and getattr(node.func, 'attr', '') == 'create_service':
                named = [str(one.value) for one in node.args[1:2] if isinstance(one, ast.Constant)]
                served.update(named)
            if isinstance(node, ast.ImportFrom) and (node.module or '').startswith(f'{package}.'):
                waiting.append(ROOT / package / f'{str(node.module).replace(".", "/")}.py')
    return words, served


def _add_enclave(enclaves: ET.Element, node: str, rights: Rights) -> None:
    enclave = ET.SubElement(enclaves, 'enclave', path=f'{NAMESPACE}/{node}')
    profiles = ET.SubElement(enclave, 'profiles')
    profile = ET.SubElement(profiles, 'profile', ns=NAMESPACE, node=node)
    full: Rights = {key: set(names) for key, names in rights.items()}
    for attribute, names in COMMON_TOPICS.items():
        full.setdefault(('topics', attribute), set()).update(names)
    full.setdefault(('services', 'reply'), set()).update(COMMON_SERVICES)
    for (element, attribute), names in sorted(full.items()):
        group = ET.SubElement(profile, element, {attribute: 'ALLOW'})
        for name in sorted(names):
            ET.SubElement(group, element.removesuffix('s')).text = name
