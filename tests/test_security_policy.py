"""Tests of the security policy: rates reach the pumps through the guard and no other way."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from porotwin_core.ros.senders import GUARD

POLICY = Path(__file__).resolve().parents[1] / 'porotwin_guard' / 'config' / 'porotwin.policy.xml'


def nodes_with(element: str, attribute: str, name: str) -> set[str]:
    """Return the nodes that may `attribute` the `element` called `name`."""
    root = ET.parse(POLICY).getroot()
    return {
        profile.attrib['node']
        for profile in root.iter('profile')
        for group in profile.iter(element)
        if group.attrib == {attribute: 'ALLOW'}
        and name in [item.text for item in group.iter(element.removesuffix('s'))]
    }


@pytest.mark.parametrize(
    ('element', 'attribute', 'name', 'nodes'),
    [
        ('topics', 'publish', 'wells/setpoint', {GUARD}),
        ('services', 'request', 'asset/control', {GUARD}),
        ('services', 'request', 'guard/control', {'hub'}),
        ('services', 'reply', 'guard/control', {GUARD}),
        ('services', 'reply', 'asset/control', {'operator', 'pumps', 'virtual_rig'}),
        ('topics', 'publish', 'guard/_vouched', {GUARD}),
        ('topics', 'subscribe', 'guard/_vouched', {'operator', 'pumps', 'recorder', 'virtual_rig'}),
        ('topics', 'publish', 'hub/_vouched', {'hub'}),
        ('topics', 'publish', 'mend/_vouched', {'mend'}),
        ('services', 'request', 'operator/confirm', {'page'}),
        ('services', 'request', 'solver/set_effects', {'mend'}),
        ('services', 'reply', 'solver/set_effects', {'solver'}),
        ('services', 'request', 'mend/answer', {'page'}),
        ('services', 'request', 'costa/save', set()),
        ('actions', 'call', 'costa/train', {'trainer'}),
        ('topics', 'subscribe', 'trainer/_vouched', {'costa', 'recorder'}),
        ('topics', 'publish', 'mend/offer', {'mend'}),
        ('topics', 'publish', 'model/effects', {'solver'}),
    ],
)
def test_only_the_guard_may_command_rates(
    element: str, attribute: str, name: str, nodes: set[str]
) -> None:
    assert nodes_with(element, attribute, name) == nodes


def test_every_node_has_an_enclave_of_its_own() -> None:
    root = ET.parse(POLICY).getroot()
    for enclave in root.iter('enclave'):
        profiles = list(enclave.iter('profile'))
        assert [f'{p.attrib["ns"]}/{p.attrib["node"]}' for p in profiles] == [
            enclave.attrib['path']
        ]
