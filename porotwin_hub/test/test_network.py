"""Tests of the section `network` of a parameter file."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_hub.launching.graph import GraphSettings, live_graph
from porotwin_hub.launching.network import Network, network_of


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / 'params.yaml'
    path.write_text(text)
    return path


def test_peers_and_a_discovery_server_become_variables_of_the_nodes(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        'network: {namespace: rig2, domain: 7, peers: [lab1, 10.0.0.2]}\n'
        '/rig2/hub: {ros__parameters: {model_timeout_s: 5.0}}\n',
    )
    network = network_of(path)
    assert network.namespace == '/rig2'
    assert network.environment() == {
        'ROS_DOMAIN_ID': '7',
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_STATIC_PEERS': 'lab1;10.0.0.2',
    }
    server = Network(discovery_server='10.0.0.2:11811').environment()
    assert server['ROS_DISCOVERY_SERVER'] == '10.0.0.2:11811'
    assert server['ROS_SUPER_CLIENT'] == 'TRUE'
    assert Network().environment() == {}
    nodes = live_graph(
        GraphSettings(rig=Path('rig.yaml'), photos=Path('photos'), params=path, namespace='/rig2')
    )
    assert {node.namespace for node in nodes} == {'/rig2'}
    hub = next(node for node in nodes if node.name == 'hub')
    assert hub.parameters['model_timeout_s'] == 5.0


@pytest.mark.parametrize(
    ('section', 'complaint'),
    [
        ('{peer: [lab1]}', "unknown key 'peer'; did you mean 'peers'"),
        ('{peers: lab1}', 'peers needs a list'),
        ('{domain: 400}', 'number from 0 to 232'),
        ('{namespace: 2nd}', 'a letter first'),
        ('{discovery_server: lab1}', 'write HOST:PORT'),
        ('{peers: [lab1], discovery_server: "lab1:11811"}', 'not both'),
        ('[lab1]', 'is no section'),
    ],
)
def test_a_wrong_network_is_refused_in_one_line(
    tmp_path: Path, section: str, complaint: str
) -> None:
    with pytest.raises(InputError, match=complaint) as refusal:
        network_of(written(tmp_path, f'network: {section}\n'))
    assert '\n' not in str(refusal.value)


def test_a_machine_starts_the_nodes_that_are_named() -> None:
    everything = GraphSettings(rig=Path('rig.yaml'), photos=Path('photos'), nodes='solver, costa')
    nodes = {node.name: node for node in live_graph(everything)}
    assert list(nodes) == ['solver', 'costa', 'supervisor']
    assert nodes['supervisor'].parameters['nodes'] == 'solver costa'
    with pytest.raises(InputError, match="no node is named 'slover'; known: "):
        live_graph(GraphSettings(rig=Path('rig.yaml'), photos=Path('photos'), nodes='slover'))
