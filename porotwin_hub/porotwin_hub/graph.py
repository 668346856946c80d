"""The one description of the node graph: `./porotwin up`, `demo` and the launch file start this.

A node is a package, an executable (which is also a module of that package) and its parameters.
Names of topics and services are relative to the namespace, `/clock` and `/diagnostics` apart.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

NAMESPACE = '/porotwin'

TRAINING_PAIRS = 'pairs'
TRAINED_MODEL = 'model.safetensors'
"""Names in the folder of retraining: the pairs that the trainer collects, and the weights."""

Parameter = bool | int | float | str


@dataclass(frozen=True)
class NodeDescription:
    """One process of the graph."""

    name: str
    package: str
    executable: str
    parameters: dict[str, Parameter] = field(default_factory=dict)
    remappings: dict[str, str] = field(default_factory=dict)

    @property
    def module(self) -> str:
        """Return the module to run where executables are not installed."""
        return f'{self.package}.{self.executable}'


def _option(default: Any, description: str) -> Any:
    return field(default=default, metadata={'description': description})


@dataclass(frozen=True)
class GraphSettings:
    """What a user chooses when the graph starts; the arguments of the launch file."""

    rig: Path = field(metadata={'description': 'path of rig.yaml'})
    photos: Path | None = _option(None, 'folder to watch for photographs')
    device: str = _option('', 'camera device, such as /dev/video0, instead of a folder')
    calibration: Path | None = _option(None, 'calibration of the photographs')
    model: Path | None = _option(None, 'COSTA model to load; without one the correction is zero')
    grid: str = _option('', 'columns x rows of the maps; empty: cells of about 5 mm')
    preset: str = _option('fast', 'scheme of the physics-based model: fast, accurate or upwind')
    photo_interval_s: float = _option(30.0, 'time between photographs [s]')
    horizon_s: float = _option(600.0, 'how far the optimiser looks ahead [s]')
    evaluations: int = _option(60, 'predictions that one optimisation may ask for')
    control: bool = _option(True, 'choose setpoints, when rig.yaml says what may be controlled')
    retrain_every: int = _option(0, 'retrain COSTA after so many new states; 0: never')
    architecture: str = _option('', 'network to train; empty: the one of the loaded model')
    training: Path | None = _option(None, 'folder for training pairs and weights of retraining')
    record: Path | None = _option(None, 'bag to record everything into')
    diagnoses: Path | None = _option(None, 'folder for diagnoses of the run, made when asked for')
    page: str = _option('', 'HOST:PORT of the page; empty: no page')
    speak: bool = _option(False, 'speak setpoints with espeak-ng')
    use_sim_time: bool = _option(False, 'take the time from /clock')


def twin_nodes(settings: GraphSettings) -> list[NodeDescription]:
    """Return the nodes of the twin itself, without what stands for the physical asset."""
    common: dict[str, Parameter] = {'rig': str(settings.rig), 'use_sim_time': settings.use_sim_time}
    mapped = {**common, 'grid': settings.grid} if settings.grid else common
    calibration = {'calibration': str(settings.calibration)} if settings.calibration else {}
    modelled = {**mapped, 'preset': settings.preset}
    nodes = [
        NodeDescription(
            'imaging',
            'porotwin_imaging',
            'imaging_node',
            {**mapped, **calibration},
        ),
        NodeDescription('solver', 'porotwin_solver', 'solver_node', modelled),
        _costa_node(settings, modelled),
        NodeDescription(
            'hub',
            'porotwin_hub',
            'hub_node',
            {
                **mapped,
                'photo_interval_s': settings.photo_interval_s,
                'horizon_s': settings.horizon_s,
                'evaluations': settings.evaluations,
                'control': settings.control,
            },
        ),
    ]
    if settings.retrain_every > 0:
        nodes.append(_trainer_node(settings, modelled))
    if settings.record is not None:
        nodes.append(
            NodeDescription(
                'recorder',
                'porotwin_recording',
                'recorder_node',
                {
                    'output': str(settings.record),
                    'continues': True,
                    'use_sim_time': settings.use_sim_time,
                },
            )
        )
    if settings.diagnoses is not None:
        nodes.append(
            NodeDescription(
                'diagnosis',
                'porotwin_diagnosis',
                'diagnosis_node',
                {**modelled, 'output': str(settings.diagnoses)},
            )
        )
    if settings.page:
        nodes.append(
            NodeDescription(
                'page', 'porotwin_page', 'page_node', {**common, 'address': settings.page}
            )
        )
    return nodes


def _costa_node(settings: GraphSettings, common: dict[str, Parameter]) -> NodeDescription:
    """Return the data-driven model; started again, it uses the weights of the last retraining."""
    parameters = {**common}
    if settings.model is not None:
        parameters['model'] = str(settings.model)
    if settings.architecture:
        parameters['architecture'] = settings.architecture
    if settings.training is not None:
        parameters['trained_model'] = str(settings.training / TRAINED_MODEL)
    return NodeDescription('costa', 'porotwin_costa', 'costa_node', parameters)


def _trainer_node(settings: GraphSettings, common: dict[str, Parameter]) -> NodeDescription:
    """Return the trainer; its pairs and weights are files, so that a restart continues with them.

    The node costa chooses the network, because it knows the loaded model.
    """
    parameters = {
        **common,
        'photo_interval_s': settings.photo_interval_s,
        'retrain_every': settings.retrain_every,
        'architecture': settings.architecture,
    }
    if settings.training is not None:
        parameters['dataset'] = str(settings.training / TRAINING_PAIRS)
        parameters['output'] = str(settings.training / TRAINED_MODEL)
    return NodeDescription('trainer', 'porotwin_costa', 'trainer_node', parameters)


def camera_node(settings: GraphSettings) -> NodeDescription:
    """Return the node that brings photographs in, from a folder or a device."""
    parameters: dict[str, Parameter] = {
        'use_sim_time': settings.use_sim_time,
        'listeners': 1 if settings.record is None else 2,  # imaging and recorder
    }
    if settings.device:
        parameters |= {'device': settings.device, 'period': settings.photo_interval_s}
    else:
        parameters['photos'] = str(settings.photos)
    return NodeDescription('camera', 'porotwin_imaging', 'camera_node', parameters)


def operator_node(settings: GraphSettings, *, asset: bool) -> NodeDescription:
    """Return the bridge to the operator; `asset`: a person sets the pumps."""
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


def live_graph(settings: GraphSettings) -> list[NodeDescription]:
    """Return the graph beside a real rig: a camera, the twin, and a person at the pumps.

    Without a source of photographs there is no camera: they are replayed from a bag.
    """
    camera = [camera_node(settings)] if settings.photos is not None or settings.device else []
    return [*twin_nodes(settings), operator_node(settings, asset=True), *camera]
