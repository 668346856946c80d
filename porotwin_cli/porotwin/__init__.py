"""PoroTwin as a library for scripts and notebooks, under one name.

Each name is loaded at its first use, so `import porotwin` takes no time, and a script that only
simulates needs neither OpenCV nor torch.

    import porotwin
    recording = porotwin.open_recording('bags/sample')
    rig, rates = recording.rig, recording.delivered
    maps = porotwin.simulate(rig, rates, recording.times, grid=recording.grid)
    recording.to_xarray().concentration.isel(time=-1).plot()
"""

import importlib
from typing import TYPE_CHECKING

from porotwin_core import __version__ as __version__
from porotwin_core.basis.errors import InputError as InputError

if TYPE_CHECKING:
    from porotwin_core.geometry.grid import FloatArray as FloatArray
    from porotwin_core.rates.wells import Schedule as Schedule
    from porotwin_core.rates.wells import WellRate as WellRate
    from porotwin_core.rig import Rig as Rig
    from porotwin_core.rig import load_rig as load_rig
    from porotwin_costa.correction.corrective_model import CorrectiveModel as CorrectiveModel
    from porotwin_costa.data.dataset_builder import build_dataset as build_dataset
    from porotwin_costa.data.frames import Frames as Frames
    from porotwin_costa.networks import architecture as architecture
    from porotwin_costa.training.training import train as train
    from porotwin_diagnosis.examine import DiagnosisSettings as DiagnosisSettings
    from porotwin_diagnosis.examine import examine
    from porotwin_hub.control.controller import Controller as Controller
    from porotwin_hub.control.setpoint_limits import Limits as Limits
    from porotwin_hub.loop.cycle import Observation as Observation
    from porotwin_hub.loop.twin import Twin as Twin
    from porotwin_hub.models.forecast import no_correction as no_correction
    from porotwin_hub.objectives.objective_registry import make_objective as make_objective
    from porotwin_imaging.baseline.baseline import make_baseline as make_baseline
    from porotwin_imaging.photo_to_map import concentration_map
    from porotwin_imaging.tracer.calibration import load_calibration as load_calibration
    from porotwin_recording.experiment.dataset_export import export_dataset as export_dataset
    from porotwin_recording.experiment.recording import Recording as Recording
    from porotwin_recording.experiment.recording import open_recording as open_recording
    from porotwin_rig.made_experiment import make_experiment as make_experiment
    from porotwin_solver.effects import EFFECTS as EFFECTS
    from porotwin_solver.effects import parse_effect as parse_effect
    from porotwin_solver.model.model import Model as Model
    from porotwin_solver.model.simulation import simulate as simulate

    diagnose, image = examine, concentration_map

PLACES = {
    'architecture': 'porotwin_costa.networks',
    'build_dataset': 'porotwin_costa.data.dataset_builder',
    'Controller': 'porotwin_hub.control.controller',
    'diagnose': 'porotwin_diagnosis.examine:examine',
    'DiagnosisSettings': 'porotwin_diagnosis.examine',
    'EFFECTS': 'porotwin_solver.effects',
    'export_dataset': 'porotwin_recording.experiment.dataset_export',
    'CorrectiveModel': 'porotwin_costa.correction.corrective_model',
    'FloatArray': 'porotwin_core.geometry.grid',
    'Frames': 'porotwin_costa.data.frames',
    'image': 'porotwin_imaging.photo_to_map:concentration_map',
    'Limits': 'porotwin_hub.control.setpoint_limits',
    'load_calibration': 'porotwin_imaging.tracer.calibration',
    'load_rig': 'porotwin_core.rig',
    'make_baseline': 'porotwin_imaging.baseline.baseline',
    'make_experiment': 'porotwin_rig.made_experiment',
    'make_objective': 'porotwin_hub.objectives.objective_registry',
    'Model': 'porotwin_solver.model.model',
    'no_correction': 'porotwin_hub.models.forecast',
    'Observation': 'porotwin_hub.loop.cycle',
    'open_recording': 'porotwin_recording.experiment.recording',
    'parse_effect': 'porotwin_solver.effects',
    'Recording': 'porotwin_recording.experiment.recording',
    'Rig': 'porotwin_core.rig',
    'Schedule': 'porotwin_core.rates.wells',
    'simulate': 'porotwin_solver.model.simulation',
    'train': 'porotwin_costa.training.training',
    'Twin': 'porotwin_hub.loop.twin',
    'WellRate': 'porotwin_core.rates.wells',
}
"""The module of each name, and its name there if it is another."""

NAMES = ('InputError', '__version__', *PLACES)


def __getattr__(name: str) -> object:
    """Load a name at its first use.

    Raises:
        AttributeError: it is not among `NAMES`.
        InputError: a library that it needs is not installed.
    """
    if name not in PLACES:
        raise AttributeError(f'porotwin has no {name}; it has {", ".join(NAMES)}')
    module, _, own_name = PLACES[name].partition(':')
    try:
        value = getattr(importlib.import_module(module), own_name or name)
    except ModuleNotFoundError as error:
        raise InputError(
            f'porotwin.{name}: {error}; pip install ".[all]" in the checkout'
        ) from error
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(NAMES)
