"""The rules of the architecture, checked on the source: who may import whom."""

import ast
import re
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent.name for path in ROOT.glob('porotwin_*/setup.py'))
MODULES = sorted(path for package in PACKAGES for path in (ROOT / package / package).rglob('*.py'))

LAB = 'lab'
"""The laboratory: it may import every package and is not installed; nothing imports it."""

LAB_MODULES = sorted(
    path for path in (ROOT / LAB).rglob('*.py') if 'test' not in path.relative_to(ROOT).parts
)

ROS = {'rclpy', 'launch', 'launch_ros'}
MESSAGES = {
    'porotwin_msgs', 'sensor_msgs', 'std_msgs', 'diagnostic_msgs', 'rosgraph_msgs',
    'builtin_interfaces', 'rcl_interfaces', 'std_srvs',
}  # fmt: skip

ROS_SHELLS = {
    'porotwin_core/qos.py': 'names the qualities of service',
    'porotwin_core/node.py': 'shared by all nodes',
    'porotwin_core/plain_log.py': 'the logger of all nodes',
    'porotwin_core/node_thread.py': 'spins nodes beside other work',
    'porotwin_core/model_effects.py': 'subscribes to the effects of the solver',
    'porotwin_core/following.py': 'subscribes to topics whose sender matters',
    'porotwin_core/run_topics.py': 'subscribes to the course of a run',
    'porotwin_core/vouching.py': 'asks the one node that may call a service',
    'porotwin_core/single_instance.py': 'finds other nodes of the same name',
    'porotwin_core/conversions.py': 'the one place that converts messages',
    'porotwin_recording/bag_conversion.py': 'makes the bag that a live run would have recorded',
    'porotwin_recording/player.py': 'turns recorded setpoints into measured rates',
    'porotwin_recording/replay_audience.py': 'looks at the graph that a replay plays into',
    'porotwin_recording/replay_topics.py': 'publishes the topics of a replay',
    'porotwin_hub/clients.py': 'service clients as callables',
    'porotwin_hub/cycle_report.py': 'turns cycles into reports',
    'porotwin_hub/planner_parameters.py': 'declares parameters of the hub',
    'porotwin_siblings/siblings_messages.py': 'turns states and outlooks from and into messages',
    'porotwin_cli/graph_watch.py': 'listens to a running graph',
    'porotwin_cli/live_confirmation.py': 'answers a running graph',
    'porotwin_cli/live_diagnosis.py': 'asks a running graph',
    'porotwin_cli/live_node.py': 'the node of a command',
    'porotwin_cli/live_mend.py': 'answers a running graph',
}
"""Modules beside *_node.py that may know ROS, and why."""

MAY_IMPORT = {
    'porotwin_core': set(),
    'porotwin_checks': {'porotwin_core', 'porotwin_solver'},
    'porotwin_recording': {'porotwin_core', 'porotwin_checks', 'porotwin_solver'},
    'porotwin_imaging': {'porotwin_core'},
    'porotwin_solver': {'porotwin_core'},
    'porotwin_siblings': {'porotwin_core', 'porotwin_solver'},
    'porotwin_costa': {'porotwin_core', 'porotwin_recording'},
    'porotwin_hub': {'porotwin_core', 'porotwin_checks', 'porotwin_solver'},
    'porotwin_guard': {'porotwin_core'},  # it judges the hub, so it shares no limits with it
    'porotwin_pumps': {'porotwin_core'},
    'porotwin_rig': {'porotwin_core', 'porotwin_recording'},
    'porotwin_page': {'porotwin_core'},
    'porotwin_diagnosis': {
        'porotwin_core', 'porotwin_checks', 'porotwin_recording', 'porotwin_solver',
    },
    'porotwin_cli': set(PACKAGES),
}  # fmt: skip
"""Imports point one way; the virtual rig and the solver, above all, share no numerics."""

ROOMS = {
    'porotwin_core': ('basis', 'clock', 'geometry', 'rig', 'rates', 'model', 'ros'),
    'porotwin_checks': (
        'known', 'near_wells', 'tracer_errors', 'start', 'checks', 'all_checks',
    ),
    'porotwin_recording': (
        'tables', 'mcap', 'experiment', 'importers', 'live', 'player_node', 'recorder_node',
    ),
    'porotwin_imaging': (
        'numerics', 'photograph', 'sources', 'camera', 'geometry', 'tracer',
        'smoothing', 'light', 'baseline', 'photo_to_map', 'calibrating', 'live', 'measures',
        'phases', 'camera_node', 'imaging_node',
    ),
    'porotwin_solver': (
        'coefficients', 'effects', 'flow', 'transport', 'model', 'adjoint', 'service',
        'solver_node',
    ),
    'porotwin_costa': (
        'data', 'networks', 'correction', 'training', 'evaluation',
        'costa_node', 'trainer_node',
    ),
    'porotwin_hub': (
        'models', 'objectives', 'control', 'estimation', 'operator', 'loop', 'launching',
        'hub_node', 'operator_node', 'supervisor_node',
    ),
    'porotwin_diagnosis': (
        'thresholds', 'progress', 'kept_simulations', 'data', 'model', 'search', 'decision',
        'advice', 'diagnosis', 'report', 'examine', 'archive', 'diagnosis_node', 'mending',
        'mend_node', 'history',
    ),
    'porotwin_cli': (
        'terminal', 'workspace', 'kernels', 'interrupts', 'memory_limit', 'options',
        'recorded', 'photographs', 'checking', 'pictures', 'running', 'commands', 'app',
        '__main__',
    ),
    LAB: (
        'study', 'budget', 'verification', 'photographs', 'blind', 'stored', 'benches', 'loop',
        'faults', 'scaling', 'paper_experiments', 'commands',
    ),
}  # fmt: skip
"""Sub-packages and modules of a package; each may import only those before it and itself."""


@cache
def import_statements(module: Path) -> tuple[tuple[str, str], ...]:
    """Return what a module imports, wherever in it, as pairs (module, name); relative ones never.

    The name is empty in `import module`.
    """
    found: list[tuple[str, str]] = []
    for node in ast.walk(ast.parse(module.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            found += [(alias.name, '') for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module is not None and node.level == 0:
            found += [(node.module, alias.name) for alias in node.names]
    return tuple(found)


def imported(module: Path) -> set[str]:
    """Return the top-level names that a module imports, wherever in it."""
    return {source.split('.')[0] for source, _ in import_statements(module)}


def name_of(module: Path) -> str:
    """Return the dotted name of a module; of an __init__.py the name of its package."""
    parts = module.relative_to(ROOT).with_suffix('').parts
    parts = parts if parts[0] == LAB else parts[1:]
    return '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)


@cache
def imports_within(package: str) -> dict[str, set[str]]:
    """Return the modules of `package` that each of its modules imports, wherever in it.

    Imports under TYPE_CHECKING and within functions count too.
    """
    paths = LAB_MODULES if package == LAB else (ROOT / package / package).rglob('*.py')
    modules = {name_of(path): path for path in paths}
    graph: dict[str, set[str]] = {}
    for name, path in modules.items():
        found: set[str] = set()
        for source, imported_name in import_statements(path):
            # `from package import module` imports the module, not only a name
            submodule = f'{source}.{imported_name}'
            found.add(submodule if submodule in modules else source)
        graph[name] = (found & modules.keys()) - {name}
    return graph


def short(module: Path) -> str:
    """Return package/module.py."""
    return f'{module.relative_to(ROOT).parts[0]}/{module.name}'


def modules_of(package: str) -> list[Path]:
    """Return the modules of a package."""
    return [module for module in MODULES if module.relative_to(ROOT).parts[0] == package]


@pytest.mark.parametrize('package', PACKAGES)
def test_algorithms_do_not_know_ros(package: str) -> None:
    found = {short(module): imported(module) & (ROS | MESSAGES) for module in modules_of(package)}
    knowing = {
        name
        for name, names in found.items()
        if names and not name.endswith('_node.py') and name not in ROS_SHELLS
    }
    assert not knowing, f'{sorted(knowing)} import ROS or its messages'


@pytest.mark.parametrize('package', PACKAGES)
def test_imports_point_one_way(package: str) -> None:
    assert package in MAY_IMPORT, f'add the imports of {package} to this test'
    allowed = MAY_IMPORT[package] | {package, 'porotwin_msgs'}
    for module in modules_of(package):
        ours = {name for name in imported(module) if name.startswith('porotwin_')}
        assert ours <= allowed, f'{short(module)} imports {ours - allowed}'


def test_no_package_imports_the_laboratory() -> None:
    assert not [short(module) for module in MODULES if LAB in imported(module)]


@pytest.mark.parametrize('package', [*PACKAGES, LAB])
def test_no_modules_import_each_other_in_a_circle(package: str) -> None:
    try:
        TopologicalSorter(imports_within(package)).prepare()
    except CycleError as error:
        pytest.fail(f'circle of imports: {" -> ".join(error.args[1])}')


@pytest.mark.parametrize('package', ROOMS)
def test_imports_follow_the_order_of_the_rooms(package: str) -> None:
    def room(module: str) -> str:
        return module.partition('.')[2].partition('.')[0]

    order = ROOMS[package]
    late = []
    for module, others in imports_within(package).items():
        if not room(module):
            continue
        assert room(module) in order, f'say in this test where {room(module)} stands'
        before = order[: order.index(room(module)) + 1]
        late += [
            f'{module} <- {other}' for other in sorted(others) if room(other) not in (*before, '')
        ]
    assert not late, f'imports of rooms that come after: {late}'


@pytest.mark.parametrize('package', PACKAGES)
def test_a_package_declares_what_it_imports(package: str) -> None:
    declared = (ROOT / package / 'package.xml').read_text(encoding='utf-8')
    used = {
        name
        for module in modules_of(package)
        for name in imported(module)
        if (name.startswith('porotwin_') or name in ROS | MESSAGES) and name != package
    }
    missing = sorted(name for name in used if f'>{name}<' not in declared)
    assert not missing, f'{package}/package.xml lacks {missing}'


def test_allowed_shells_exist() -> None:
    known = {short(module) for module in MODULES}
    assert set(ROS_SHELLS) <= known


def test_test_modules_have_names_of_their_own() -> None:
    folders = ('porotwin_*/test', 'lab/test', 'tests')
    paths = [path for folder in folders for path in ROOT.glob(f'{folder}/**/test_*.py')]
    names = [path.name for path in paths]
    twice = sorted({name for name in names if names.count(name) > 1})
    assert not twice, f'pytest imports test modules by name; rename one of {twice}'


def test_one_module_opens_netcdf_files_for_reading() -> None:
    opens = re.compile(r'netCDF4\.Dataset\(([^()]|\([^()]*\))*\)')
    for package in PACKAGES:
        for module in (ROOT / package / package).rglob('*.py'):
            for found in opens.finditer(module.read_text(encoding='utf-8')):
                writes = re.search(r"'[aw]'\)$", found.group())
                assert writes or module.name == 'netcdf_file.py', f'{module}: {found.group()}'
