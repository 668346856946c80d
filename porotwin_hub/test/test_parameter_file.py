"""Tests of parameter files: the nodes they reach, and the line for each mistake."""

import re
from pathlib import Path

import pytest
import yaml

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.parameter_rule import ParameterRule
from porotwin_hub.launching.graph import NodeDescription
from porotwin_hub.launching.parameter_file import known_rules, template, with_parameters


def rule(name: str, default: object, **limits: object) -> ParameterRule:
    return ParameterRule(name, default, f'meaning of {name}', **limits)


RULES = {
    'hub': {
        'horizon_s': rule('horizon_s', 600.0, at_least=1.0),
        'photo_interval_s': rule('photo_interval_s', 30.0),
        'seed': rule('seed', 1),
    },
    'camera': {
        'patience': rule('patience', 10.0),
        'photo_interval_s': rule('photo_interval_s', 30.0),
        'light.gain': rule('light.gain', 1.0),
    },
    'trainer': {'seed': rule('seed', 1)},
}
NODES = [
    NodeDescription('hub', 'p', 'hub_node', {'photo_interval_s': 30.0, 'horizon_s': 600.0}),
    NodeDescription('camera', 'p', 'camera_node', {'photo_interval_s': 30.0}),
]


def given(folder: Path, text: str) -> dict[str, dict[str, object]]:
    """Return the parameters of the nodes with a file of this content."""
    path = folder / 'parameters.yaml'
    path.write_text(text)
    return {node.name: node.parameters for node in with_parameters(NODES, path, RULES)}


@pytest.mark.parametrize(
    'text',
    [
        '/porotwin/hub: {ros__parameters: {horizon_s: 900}}',
        'porotwin: {hub: {ros__parameters: {horizon_s: 900.0}}}',
        'hub: {ros__parameters: {horizon_s: 900.0}}',
        '/**: {ros__parameters: {horizon_s: 900.0}}',
        '/**/hub: {ros__parameters: {horizon_s: 900.0}}',
        '/porotwin/*: {ros__parameters: {horizon_s: 9e2}}',
        '/**: {ros__parameters: {horizon_s: 5.0}}\nhub: {ros__parameters: {horizon_s: 900.0}}',
        'hub: {ros__parameters: {horizon_s: 900.0}}\n/**: {ros__parameters: {horizon_s: 5.0}}',
    ],
)
def test_a_node_is_named_as_in_ros(text: str, tmp_path: Path) -> None:
    nodes = given(tmp_path, text)
    assert nodes['hub'] == {'photo_interval_s': 30.0, 'horizon_s': 900.0}
    assert nodes['camera'] == {'photo_interval_s': 30.0}


def test_a_parameter_in_a_section_has_a_point_in_its_name(tmp_path: Path) -> None:
    nodes = given(tmp_path, 'camera: {ros__parameters: {light: {gain: 2}}}')
    assert nodes['camera']['light.gain'] == 2.0


def test_what_ros2_param_dump_writes_is_accepted(tmp_path: Path) -> None:
    dump = """
/porotwin/hub:
  ros__parameters:
    horizon_s: 900.0
    photo_interval_s: 30.0
    qos_overrides:
      /parameter_events:
        publisher: {depth: 1000, durability: volatile, history: keep_last, reliability: reliable}
    start_type_description_service: true
    use_sim_time: false
"""
    assert given(tmp_path, dump)['hub'] == {'photo_interval_s': 30.0, 'horizon_s': 900.0}


def test_a_node_that_does_not_run_is_checked_and_not_used(tmp_path: Path) -> None:
    assert set(given(tmp_path, 'trainer: {ros__parameters: {seed: 3}}')) == {'hub', 'camera'}
    with pytest.raises(InputError, match="'seed' of trainer is 'x'; give a whole number"):
        given(tmp_path, 'trainer: {ros__parameters: {seed: x}}')


@pytest.mark.parametrize('text', ['', 'hub:\n  ros__parameters:\n', '# only a comment'])
def test_an_empty_file_changes_nothing(text: str, tmp_path: Path) -> None:
    assert given(tmp_path, text) == {node.name: node.parameters for node in NODES}


def test_what_all_nodes_share_may_be_repeated_but_not_changed(tmp_path: Path) -> None:
    given(tmp_path, '/**: {ros__parameters: {photo_interval_s: 30, use_sim_time: false}}')
    for text, option in (
        ('/**: {ros__parameters: {photo_interval_s: 60}}', '--photo-interval-s'),
        ('hub: {ros__parameters: {use_sim_time: true}}', '--replay'),
    ):
        with pytest.raises(InputError, match=f'same for all nodes; set it by the option {option}'):
            given(tmp_path, text)


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('hab: {ros__parameters: {horizon_s: 900}}', "no node is named 'hab'; did you mean 'hub'?"),
        ('xyz: {ros__parameters: {}}', "no node is named 'xyz'; known: camera, hub, trainer"),
        ('/other/*: {ros__parameters: {seed: 1}}', "no node is named 'other/*'"),
        (
            'hub: {ros__parameters: {horizons: 9}}',
            "'horizons' is no parameter of hub; did you mean 'horizon_s'?",
        ),
        ('/**: {ros__parameters: {nothing: 9}}', "'nothing' is no parameter of any node of '/**'"),
        (
            'hub: {ros__parameters: {horizon_s: 0.5}}',
            "parameter 'horizon_s' of hub is 0.5; it must be at least 1",
        ),
        ('hub: {ros__parameters: {horizon_s: long}}', "'horizon_s' of hub is 'long'"),
        ('hub: {ros__parameters: {horizon_s: }}', "'horizon_s' of hub is None; give a number"),
        ('hub: {horizon_s: 900}', "'/hub/horizon_s' is no section; write NODE:"),
        ('ros__parameters: {horizon_s: 900}', 'ros__parameters stands without a node'),
        ('hub: {ros__parameters: [1]}', "ros__parameters of '/hub' is no section"),
        ('- hub', "'the file' is no section"),
        ('hub: {', 'not readable as YAML'),
        ('hub: {ros__parameters: {seed: 1, seed: 2}}', "the key 'seed' stands twice"),
    ],
)
def test_a_mistake_is_one_line_with_the_file(text: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=re.escape(complaint)) as error:
        given(tmp_path, text)
    assert str(error.value).startswith(f'{tmp_path / "parameters.yaml"}: ')
    assert '\n' not in str(error.value)


def test_a_missing_file_says_how_to_get_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='no such file'):
        with_parameters(NODES, tmp_path / 'nowhere.yaml', RULES)


def test_the_template_is_a_parameter_file_that_changes_nothing(tmp_path: Path) -> None:
    text = template(RULES, {'hub': ['horizon_s'], 'trainer': ['seed']})
    assert given(tmp_path, text)['hub']['horizon_s'] == 600.0
    assert yaml.safe_load(text)['/porotwin/camera']['ros__parameters'] == {
        'light.gain': 1.0,
        'patience': 10.0,
    }
    assert '    # meaning of horizon_s (at least 1)\n    # horizon_s: 600.0\n' in text


def test_every_parameter_of_every_node_has_a_meaning() -> None:
    rules = known_rules()
    assert {'hub', 'imaging', 'camera', 'solver', 'supervisor'} <= set(rules)
    assert all(rule.description for parameters in rules.values() for rule in parameters.values())
