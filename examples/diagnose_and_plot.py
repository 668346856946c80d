"""Find a hidden effect: record the virtual rig, and let the diagnosis explain the gap.

The sand of the virtual rig has a porosity that is 12 % lower than described. The diagnosis knows
only the description and the recorded maps. Most effects are excluded here, so that it is quick.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
from picture import draw_map, picture_path

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import load_rig
from porotwin_diagnosis.examine import DiagnosisSettings, examine
from porotwin_recording.experiment.recording import open_recording
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.map_camera import MapNoise
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.effects import EFFECTS, parse_effect

SMALL_RIG = Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'
CONSIDERED = ('porosity', 'rate', 'decay')

rig = load_rig(SMALL_RIG)
schedule = Schedule.constant(
    {
        'injector': WellRate(from_ml_h(450.0), 1.0),
        'control2': WellRate(from_ml_h(150.0), 0.0),
        'producer': WellRate(from_ml_h(-500.0)),
    }
)
with tempfile.TemporaryDirectory() as folder:
    make_experiment(
        Path(folder) / 'recording',
        VirtualRig(rig, effects=[parse_effect('porosity:factor=0.88')], cell=0.004),
        commanded=schedule,
        duration=2700.0,
        photo_interval=90.0,
        seed=3,
        noise=MapNoise.drawn(3),
        grid=rig.grid(62, 37),
    )
    recording = open_recording(Path(folder) / 'recording')
    excluded = [name for name in EFFECTS if name not in CONSIDERED]
    result = examine([recording], DiagnosisSettings(excluded=excluded))

verdict, part = result.verdict, result.held_out[0]
(found,) = verdict.model.effects
factor = float(found.parameters['factor'])
print(f'{verdict.name}, confidence {verdict.confidence:.2f}, in {result.seconds:.0f} s: ', end='')
print(EFFECTS[found.name].phrase(found.parameters))
print(f'held-out error {part.error_before:.3f} before, {part.error_after:.3f} after')
assert verdict.name == 'porosity'
assert abs(factor - 0.88) < 0.02

figure, axes = plt.subplots(1, 4, figsize=(12, 2.1), layout='constrained', sharey=True)
shown = (part.observed[-1], part.before[-1], part.after[-1])
for axis, values, title in zip(axes, shown, ('observed', 'before', 'after'), strict=False):
    image = draw_map(axis, rig, values, title=f'{title}, {part.times[-1] / 60:.0f} min')
figure.colorbar(image, ax=axes[:3], shrink=0.9, label='concentration [-]')
gap = draw_map(axes[3], rig, shown[0] - shown[1], title='observed - before', cmap='RdBu_r', vmin=-1)
figure.colorbar(gap, ax=axes[3], shrink=0.9, label='difference [-]')
for axis in axes[1:]:
    axis.label_outer()
figure.savefig(picture_path(__file__), dpi=90)
