"""The description of the node graph, for `./porotwin up`, `./porotwin demo` and the launch file."""

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import DAY_S
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S
from porotwin_core.model.preset_names import PRESET_WORDS
from porotwin_core.rates.rate_periods import OPEN_HORIZON_S
from porotwin_hub.launching.node_description import (
    NAMESPACE,
    NodeDescription,
    Parameter,
    Parameters,
)
from porotwin_hub.launching.parameter_file import known_rules, template, with_parameters

__all__ = [
    'NAMESPACE',
    'GraphSettings',
    'NodeDescription',
    'Parameter',
    'Parameters',
    'camera_node',
    'description_of',
    'in_namespace',
    'live_graph',
    'named_nodes',
    'operator_node',
    'parameter_template',
    'supervised',
    'twin_nodes',
]

TRAINING_PAIRS = 'pairs'
TRAINED_MODEL = 'model.safetensors'
"""Names in the folder of retraining: the pairs that the trainer collects, and the weights."""

EXPERIMENT_START = 'experiment_start.json'
"""Name of the file, beside the bag of a run, with the time of its first photograph."""


def _option(
    default: Any, description: str, *, least: float | None = None, most: float | None = None
) -> Any:
    return field(
        default=default, metadata={'description': description, 'least': least, 'most': most}
    )


@dataclass(frozen=True)
class GraphSettings:
    """The choices of a user at the start: options of `up` and arguments of the launch file.

    Defaults and descriptions stand here alone; see `description_of`.
    """

    rig: Path = field(
        metadata={'description': 'description of the rig: rig.yaml, or a folder with one'}
    )
    photos: Path | None = _option(None, 'folder to watch for photographs')
    camera: str = _option('', 'camera source instead of a folder: /dev/video0, or NAME:ADDRESS')
    calibration: Path | None = _option(None, 'calibration of the camera')
    model: Path | None = _option(None, 'COSTA model to load; none: forecasts are not corrected')
    grid: str = _option('', 'columns x rows of the maps; empty: cells of about 5 mm')
    preset: str = _option('fast', f'scheme of the physics-based model: {PRESET_WORDS}')
    photo_interval_s: float = _option(
        USUAL_PHOTO_INTERVAL_S, 'time between photographs [s]', least=0.1, most=DAY_S
    )
    horizon_s: float = _option(
        OPEN_HORIZON_S,
        'how far plans look ahead if rig.yaml names no end of the experiment [s]',
        least=1.0,
        most=DAY_S,
    )
    evaluations: int = _option(60, 'most predictions of one optimisation')
    siblings: bool = _option(False, 'forecast with bands, and answer what-if')
    control: bool = _option(True, 'choose setpoints, if rig.yaml has a control section')
    retrain_every: int = _option(
        0, 'retrain COSTA after this number of new states; 0: never', least=0
    )
    architecture: str = _option('', 'network to train; empty: the one of the loaded model')
    training: Path | None = _option(None, 'folder for training pairs and weights of retraining')
    record: Path | None = _option(None, 'bag to record everything into')
    diagnoses: Path | None = _option(None, 'folder for diagnoses of the running experiment')
    mend: str = _option('off', 'offer what a diagnosis of the running twin found: ask or off')
    page: str = _option('', 'HOST:PORT of the page; empty: no page')
    page_token: Path | None = _option(
        None, 'file with the token of confirmations on the page, made if missing; none: a new token'
    )
    display: bool = _option(False, 'publish maps and rates for Foxglove, RViz, rqt and PlotJuggler')
    speak: bool = _option(False, 'speak setpoints with espeak-ng')
    pumps: Path | None = _option(None, 'file of the pumps; none: a person sets them')
    namespace: str = _option(NAMESPACE, 'namespace of the nodes; each rig has its own')
    nodes: str = _option('', 'nodes to start on this machine, with commas; empty: all')
    use_sim_time: bool = _option(False, 'take the time from /clock')
    params: Path | None = _option(None, 'parameters of single nodes, a parameter file of ROS 2')


def description_of(option: str) -> str:
    """Return the description of an option of `GraphSettings`, as a sentence.

    Raises:
        KeyError: there is no such option.
    """
    options = {item.name: item for item in dataclasses.fields(GraphSettings)}
    description = str(options[option].metadata['description'])
    return f'{description[0].upper()}{description[1:]}.'


def twin_nodes(settings: GraphSettings) -> list[NodeDescription]:
    """Return the nodes of the twin, without the nodes that represent the physical asset."""
    common: Parameters = {'rig': str(settings.rig), 'use_sim_time': settings.use_sim_time}
    mapped = {**common, 'grid': settings.grid} if settings.grid else common
    modelled = {**mapped, 'preset': settings.preset}
    return [
        _imaging_node(settings, mapped),
        NodeDescription('solver', 'porotwin_solver', 'solver_node', modelled),
        _costa_node(settings, modelled),
        _hub_node(settings, mapped),
        _guard_node(settings, common),
        *_siblings_node(settings, mapped),
        *_trainer_node(settings, modelled),
        *_recorder_node(settings),
        *_diagnosis_node(settings, modelled),
        *_mend_node(settings, modelled),
        *page_node(settings),
        *_display_node(settings),
    ]


def _imaging_node(settings: GraphSettings, mapped: Parameters) -> NodeDescription:
    """Return imaging; it keeps the start of the experiment beside the bag of the run."""
    parameters = {**mapped}
    if settings.calibration is not None:
        parameters['calibration'] = str(settings.calibration)
    if settings.record is not None and not settings.use_sim_time:
        parameters['experiment_start'] = str(settings.record.with_name(EXPERIMENT_START))
    return NodeDescription('imaging', 'porotwin_imaging', 'imaging_node', parameters)


def _costa_node(settings: GraphSettings, modelled: Parameters) -> NodeDescription:
    """Return the data-driven model; started again, it uses the weights of the last retraining."""
    parameters = {**modelled}
    if settings.model is not None:
        parameters['model'] = str(settings.model)
    if settings.architecture:
        parameters['architecture'] = settings.architecture
    if settings.training is not None:
        parameters['trained_model'] = str(settings.training / TRAINED_MODEL)
    return NodeDescription('costa', 'porotwin_costa', 'costa_node', parameters)


def _trainer_node(settings: GraphSettings, modelled: Parameters) -> list[NodeDescription]:
    """Return the trainer; its pairs and weights are files, so that a restart continues with them.

    The node costa chooses the network, because it knows the loaded model.
    """
    if settings.retrain_every <= 0:
        return []
    parameters = {
        **modelled,
        'photo_interval_s': settings.photo_interval_s,
        'retrain_every': settings.retrain_every,
        'architecture': settings.architecture,
    }
    if settings.training is not None:
        parameters['dataset'] = str(settings.training / TRAINING_PAIRS)
        parameters['output'] = str(settings.training / TRAINED_MODEL)
    return [NodeDescription('trainer', 'porotwin_costa', 'trainer_node', parameters)]


def _hub_node(settings: GraphSettings, mapped: Parameters) -> NodeDescription:
    parameters = {
        **mapped,
        'photo_interval_s': settings.photo_interval_s,
        'horizon_s': settings.horizon_s,
        'evaluations': settings.evaluations,
        'control': settings.control,
    }
    return NodeDescription('hub', 'porotwin_hub', 'hub_node', parameters)


def _guard_node(settings: GraphSettings, common: Parameters) -> NodeDescription:
    """Return the node that checks the hub's setpoints on their way to the pumps."""
    parameters = {**common, 'photo_interval_s': settings.photo_interval_s}
    return NodeDescription('guard', 'porotwin_guard', 'guard_node', parameters)


def _siblings_node(settings: GraphSettings, mapped: Parameters) -> list[NodeDescription]:
    if not settings.siblings:
        return []
    parameters = {**mapped, 'photo_interval_s': settings.photo_interval_s}
    return [NodeDescription('siblings', 'porotwin_siblings', 'siblings_node', parameters)]


def _recorder_node(settings: GraphSettings) -> list[NodeDescription]:
    if settings.record is None:
        return []
    parameters: Parameters = {
        'output': str(settings.record),
        'continues': True,
        'use_sim_time': settings.use_sim_time,
    }
    return [NodeDescription('recorder', 'porotwin_recording', 'recorder_node', parameters)]


def _diagnosis_node(settings: GraphSettings, modelled: Parameters) -> list[NodeDescription]:
    if settings.diagnoses is None:
        return []
    parameters = {
        **modelled,
        'photo_interval_s': settings.photo_interval_s,
        'output': str(settings.diagnoses),
    }
    return [NodeDescription('diagnosis', 'porotwin_diagnosis', 'diagnosis_node', parameters)]


def _mend_node(settings: GraphSettings, modelled: Parameters) -> list[NodeDescription]:
    """Return the node that lets the twin get better; it needs the diagnosis."""
    if settings.diagnoses is None or settings.mend != 'ask':
        return []
    parameters = {**modelled, 'photo_interval_s': settings.photo_interval_s}
    return [NodeDescription('mend', 'porotwin_diagnosis', 'mend_node', parameters)]


def page_node(settings: GraphSettings) -> list[NodeDescription]:
    """Return the page, or nothing if there is none."""
    if not settings.page:
        return []
    parameters: Parameters = {
        'rig': str(settings.rig),
        'use_sim_time': settings.use_sim_time,
        'address': settings.page,
    }
    if settings.page_token is not None:
        parameters['token_file'] = str(settings.page_token)
    return [NodeDescription('page', 'porotwin_page', 'page_node', parameters)]


def _display_node(settings: GraphSettings) -> list[NodeDescription]:
    if not settings.display:
        return []
    parameters: Parameters = {'use_sim_time': settings.use_sim_time}
    return [NodeDescription('display', 'porotwin_page', 'display_node', parameters)]


def camera_node(settings: GraphSettings) -> NodeDescription:
    """Return the node that brings photographs in, from a folder or another camera source."""
    return NodeDescription(
        'camera',
        'porotwin_imaging',
        'camera_node',
        {
            'use_sim_time': settings.use_sim_time,
            'source': settings.camera or f'folder:{settings.photos}',
            'photo_interval_s': settings.photo_interval_s,
            'listeners': 1 if settings.record is None else 2,  # imaging and recorder
        },
    )


def operator_node(settings: GraphSettings, *, asset: bool) -> NodeDescription:
    """Return the bridge to the operator; with `asset` a person sets the pumps."""
    return NodeDescription(
        'operator',
        'porotwin_hub',
        'operator_node',
        {
            'rig': str(settings.rig),
            'use_sim_time': settings.use_sim_time,
            'asset': asset,
            'speak': settings.speak,
        },
    )


def pumps_node(settings: GraphSettings) -> list[NodeDescription]:
    """Return the node that sets the pumps by itself, if there is a file of the pumps."""
    if settings.pumps is None:
        return []
    parameters: Parameters = {
        'rig': str(settings.rig),
        'use_sim_time': settings.use_sim_time,
        'pumps': str(settings.pumps),
        'measure_period_s': settings.photo_interval_s,
    }
    return [NodeDescription('pumps', 'porotwin_pumps', 'pumps_node', parameters)]


def live_graph(settings: GraphSettings) -> list[NodeDescription]:
    """Return the graph beside a real rig: a camera, the twin, and a person or real pumps.

    Without a camera source there is no camera: photographs are replayed from a bag.

    Raises:
        InputError: the parameter file of `settings` is wrong.
    """
    camera = [camera_node(settings)] if settings.photos is not None or settings.camera else []
    pumps = pumps_node(settings)
    operator = operator_node(settings, asset=not pumps)
    here = on_this_machine([*twin_nodes(settings), operator, *pumps, *camera], settings.nodes)
    nodes = supervised(here)
    nodes = in_namespace(nodes, settings.namespace)
    return with_parameters(nodes, settings.params, known_rules()) if settings.params else nodes


def on_this_machine(nodes: list[NodeDescription], names: str) -> list[NodeDescription]:
    """Return the nodes that `names` lists; the others run on other machines.

    Args:
        nodes: all nodes of the graph.
        names: names with commas; empty: all.

    Raises:
        InputError: a name is no node.
    """
    wanted = named_nodes(names)
    return [node for node in nodes if not wanted or node.name in wanted]


def named_nodes(names: str) -> frozenset[str]:
    """Return the nodes in a text with commas; none stands for all nodes.

    Raises:
        InputError: a name is no node.
    """
    wanted = [name.strip() for name in names.split(',') if name.strip()]
    known = known_rules().keys() if wanted else ()
    for name in wanted:
        if name not in known:
            raise InputError(f"--nodes: no node is named '{name}'; known: {', '.join(known)}")
    return frozenset(wanted)


def in_namespace(nodes: list[NodeDescription], namespace: str) -> list[NodeDescription]:
    """Return `nodes` in another namespace; each of several rigs has its own."""
    return [dataclasses.replace(node, namespace=namespace) for node in nodes]


def supervised(nodes: list[NodeDescription]) -> list[NodeDescription]:
    """Return `nodes` and the node that watches them; it starts last and so ends first."""
    names = ' '.join(node.name for node in nodes)
    return [
        *nodes,
        NodeDescription('supervisor', 'porotwin_hub', 'supervisor_node', {'nodes': names}),
    ]


def parameter_template() -> str:
    """Return a parameter file with all parameters of the nodes beside a real rig."""
    somewhere = Path('folder')
    everything = GraphSettings(
        rig=somewhere,
        photos=somewhere,
        calibration=somewhere,
        model=somewhere,
        grid='columns x rows',
        retrain_every=1,
        architecture='network',
        training=somewhere,
        record=somewhere,
        diagnoses=somewhere,
        mend='ask',
        siblings=True,
        page='HOST:PORT',
        display=True,
        pumps=somewhere,
    )
    given = {node.name: node.parameters for node in live_graph(everything)}
    rules = known_rules()
    return template({node: rules[node] for node in given}, given)
