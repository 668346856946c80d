"""Turn one photograph into a map of tracer concentration.

The photographs come from the sample bag. Its first one shows the rig without tracer: the baseline.
The calibration tells how much the light of this camera changes with the concentration.
"""

from io import BytesIO
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.image import imread
from picture import draw_map, picture_path

from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.tracer.calibration import load_calibration
from porotwin_recording.experiment.recording import open_recording

BAGS = Path(__file__).parents[1] / 'bags'

recording = open_recording(BAGS / 'sample')
rig = recording.rig
assert rig.camera is not None
grid = rig.default_grid()
baseline_photos = [photo.read() for photo in recording.photos if photo.role == 'baseline']
baseline = make_baseline(
    rig,
    grid,
    baseline_photos,
    calibration=load_calibration(BAGS / 'sample_calibration.yaml'),
)

photo = recording.photos[-1]
found = concentration_map(photo.read(), baseline)
pore_volume = rig.cell_pore_volume(grid)
plume = found.values > 0.05  # the noise of clear water does not count
seen_ml = 1e6 * float((found.values * pore_volume)[plume].sum())
injector = recording.delivered.at(0.0)['injector']
injected_ml = 1e6 * injector.rate * injector.concentration * photo.time
print(f'{photo.time:.0f} s: {seen_ml:.1f} ml of tracer in the map, {injected_ml:.1f} ml injected')
print(f'imaged in {sum(found.timings.values()):.2f} s, noise {found.typical_noise:.4f}')
assert abs(seen_ml - injected_ml) < 0.05 * injected_ml

figure, axes = plt.subplots(1, 2, figsize=(9, 3.1), layout='constrained')
axes[0].imshow(imread(BytesIO(photo.read()), format='jpg'))
corners = np.array([*rig.camera.corners_px, rig.camera.corners_px[0]])
axes[0].plot(*corners.T, color='tab:red', linewidth=1, label='corners in rig.yaml')
axes[0].legend(loc='upper right', fontsize=7)
axes[0].set(title=f'photograph, {photo.time:.0f} s', xticks=[], yticks=[])
image = draw_map(axes[1], rig, found.values, title='concentration')
figure.colorbar(image, ax=axes[1], shrink=0.9, label='concentration [-]')
figure.savefig(picture_path(__file__), dpi=80)
