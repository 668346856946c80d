"""Tests of the graph's description: it agrees with the nodes, their parameters and packages."""

import ast
import dataclasses
from pathlib import Path

import pytest

from porotwin_core.rig import load_rig
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.launching.graph import (
    GraphSettings,
    NodeDescription,
    camera_node,
    description_of,
    live_graph,
    twin_nodes,
)

ROOT = Path(__file__).resolve().parents[2]
FULL = GraphSettings(
    rig=Path('rig.yaml'),
    photos=Path('photos'),
    calibration=Path('calibration.yaml'),
    model=Path('model'),
    grid='94x56',
    retrain_every=40,
    architecture='local',
    training=Path('training'),
    record=Path('bag'),
    diagnoses=Path('diagnoses'),
    mend='ask',
    siblings=True,
    page='127.0.0.1:8765',
    pumps=Path('pumps.yaml'),
)


SHARED_DECLARATIONS = {
    'declare_rig': 'rig',
    'declare_grid': 'grid',
    'declare_photo_interval': 'photo_interval_s',
}
"""Helpers of `porotwin_core.ros.node` that declare one parameter each."""


def declared_parameters(module: Path) -> set[str]:
    """Return the parameters that a node module declares by name or through a shared helper.

    Modules named `..._parameters` in its package declare parameters for it.
    """
    names: set[str] = set()
    sources = [module, *module.parent.rglob('*_parameters.py')]
    for call in [call for source in sources for call in ast.walk(ast.parse(source.read_text()))]:
        if not isinstance(call, ast.Call):
            continue
        function = getattr(call.func, 'id', getattr(call.func, 'attr', ''))
        if function in SHARED_DECLARATIONS:
            names.add(SHARED_DECLARATIONS[function])
        if function in ('declare', 'declare_parameter'):
            names |= {
                argument.value
                for argument in call.args[:2]
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str)
            }
    return names


@pytest.mark.parametrize('node', live_graph(FULL), ids=lambda node: node.name)
def test_every_parameter_given_is_one_that_the_node_declares(node: NodeDescription) -> None:
    module = ROOT / node.package / node.package / f'{node.executable}.py'
    unknown = set(node.parameters) - declared_parameters(module) - {'use_sim_time'}
    assert not unknown, f'{node.module} does not declare {unknown}'


@pytest.mark.parametrize('node', live_graph(FULL), ids=lambda node: node.name)
def test_every_executable_is_installed_by_its_package(node: NodeDescription) -> None:
    text = (ROOT / node.package / 'setup.py').read_text().replace('{PACKAGE}', node.package)
    assert f'{node.executable} = {node.module}:main' in text


@pytest.mark.parametrize('node', live_graph(FULL), ids=lambda node: node.name)
def test_every_node_runs_as_a_module(node: NodeDescription) -> None:
    text = (ROOT / node.package / node.package / f'{node.executable}.py').read_text()
    assert text.rstrip().endswith("if __name__ == '__main__':\n    main()")


def test_names_are_unique() -> None:
    names = [node.name for node in live_graph(FULL)]
    assert len(names) == len(set(names))


def test_optional_nodes_start_only_on_request() -> None:
    names = {node.name for node in twin_nodes(GraphSettings(rig=Path('rig.yaml')))}
    assert names == {'imaging', 'solver', 'costa', 'hub', 'guard'}


def test_a_recorder_that_restarts_continues_its_bag() -> None:
    recorder = next(node for node in twin_nodes(FULL) if node.name == 'recorder')
    assert recorder.parameters['continues'] is True


def test_hub_trainer_and_siblings_know_the_time_between_photographs() -> None:
    settings = GraphSettings(
        rig=Path('rig.yaml'), retrain_every=5, photo_interval_s=12.0, siblings=True
    )
    intervals = {
        node.name: node.parameters.get('photo_interval_s') for node in twin_nodes(settings)
    }
    assert [intervals[name] for name in ('hub', 'trainer', 'siblings')] == 3 * [12.0]


def test_a_device_takes_the_place_of_the_folder() -> None:
    node = camera_node(GraphSettings(rig=Path('rig.yaml'), camera='/dev/video0'))
    assert node.parameters['source'] == '/dev/video0'


def test_a_folder_of_photographs_is_a_camera_source() -> None:
    node = camera_node(GraphSettings(rig=Path('rig.yaml'), photos=Path('photos')))
    assert node.parameters['source'] == 'folder:photos'


def test_a_replay_takes_the_place_of_the_camera() -> None:
    names = {node.name for node in live_graph(GraphSettings(rig=Path('rig.yaml')))}
    assert 'operator' in names
    assert 'camera' not in names


def test_the_papers_rig_can_be_controlled() -> None:
    rig = load_rig(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    limits = Limits.of(rig)
    assert limits.violations(limits.safe()) == []


def test_costa_and_its_trainer_know_the_scheme_of_the_solver() -> None:
    settings = GraphSettings(rig=Path('rig.yaml'), retrain_every=5, preset='upwind')
    presets = {node.name: node.parameters.get('preset') for node in twin_nodes(settings)}
    assert presets['solver'] == presets['costa'] == presets['trainer'] == 'upwind'


def test_every_option_of_the_graph_has_a_description() -> None:
    names = [option.name for option in dataclasses.fields(GraphSettings)]
    assert all(description_of(name) for name in names)


def test_retraining_keeps_pairs_and_weights_in_files_that_a_restart_finds() -> None:
    nodes = {node.name: node.parameters for node in twin_nodes(FULL)}
    assert nodes['trainer']['dataset'] == 'training/pairs'
    assert nodes['trainer']['output'] == 'training/model.safetensors'
    assert nodes['costa']['trained_model'] == nodes['trainer']['output']
    assert nodes['costa']['model'] == 'model'


def test_the_chosen_network_is_trained_and_else_costa_chooses() -> None:
    nodes = {node.name: node.parameters for node in twin_nodes(FULL)}
    assert nodes['trainer']['architecture'] == nodes['costa']['architecture'] == 'local'
    settings = GraphSettings(rig=Path('rig.yaml'), retrain_every=5, training=Path('training'))
    nodes = {node.name: node.parameters for node in twin_nodes(settings)}
    assert nodes['trainer']['architecture'] == ''
    assert 'architecture' not in nodes['costa']


def test_real_pumps_take_the_place_of_a_person() -> None:
    nodes = {node.name: node.parameters for node in live_graph(FULL)}
    assert nodes['operator']['asset'] is False
    assert nodes['pumps']['pumps'] == 'pumps.yaml'
    by_hand = {node.name: node.parameters for node in live_graph(GraphSettings(Path('rig.yaml')))}
    assert by_hand['operator']['asset'] is True
    assert 'pumps' not in by_hand
