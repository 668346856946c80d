"""Run the virtual rig for 40 minutes and take its photograph, as the camera of a laboratory would.

The virtual rig stands in for the real one. It shares no numerics with the solver. Its photographs
have grains, a colour chart, a bulging lens, drifting light and noise.
"""

from io import BytesIO
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.image import imread
from picture import draw_map, picture_path

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig
from porotwin_rig.camera import camera_before
from porotwin_rig.camera_signal import signal_seen
from porotwin_rig.render import Photographer
from porotwin_rig.virtual_rig import VirtualRig

SMALL_RIG = Path(__file__).parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'

rig = load_rig(SMALL_RIG)
grid = rig.default_grid()
asset = VirtualRig(rig)
asset.set_rates(
    {
        'injector': WellRate(from_ml_h(500.0), 1.0),
        'control1': WellRate(from_ml_h(200.0), 0.0),
        'producer': WellRate(from_ml_h(-700.0)),
    }
)
asset.advance(2400.0)
in_rig_ml, injected_ml = 1e6 * asset.total_mass(), 1e6 * asset.balance.injected
removed_ml = 1e6 * asset.balance.removed
print(f'{in_rig_ml:.1f} ml in the rig, {injected_ml:.1f} ml injected, {removed_ml:.1f} ml removed')
assert abs(in_rig_ml + removed_ml - injected_ml) < 1e-3 * injected_ml

photographer = Photographer(rig, camera=camera_before(rig, 800), seed=7)
signal = signal_seen(asset, grid.refined(2), time=asset.time)
jpeg = photographer.photograph(signal, time=asset.time)
print(f'a photograph of {photographer.camera.width_px} px and {len(jpeg) / 1024:.0f} kB')

figure, axes = plt.subplots(1, 2, figsize=(9, 3.1), layout='constrained')
axes[0].imshow(imread(BytesIO(jpeg), format='jpg'))
axes[0].set(title=f'photograph, {asset.time / 60:.0f} min', xticks=[], yticks=[])
image = draw_map(axes[1], rig, asset.concentration(grid), title='true concentration')
figure.colorbar(image, ax=axes[1], shrink=0.9, label='concentration [-]')
figure.savefig(picture_path(__file__), dpi=80)
