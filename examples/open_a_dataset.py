"""Export the sample bag as zarr and go on with it as in a notebook: the cells begin with `# %%`.

xarray opens the folder (`pip install xarray`). Where it is not installed, zarr reads the
same arrays.
"""

# %% Export: the same as ./porotwin export bags/sample sample.zarr --format zarr
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import zarr
from picture import picture_path

from porotwin_recording.experiment.dataset_export import export_dataset
from porotwin_recording.experiment.recording import open_recording

BAG = Path(__file__).parents[1] / 'bags' / 'sample'
folder = Path(tempfile.mkdtemp()) / 'sample.zarr'
export_dataset(open_recording(BAG), folder, 'zarr')

# %% Open
try:
    import xarray
except ImportError:
    data = zarr.open_group(folder, mode='r')
else:
    data = xarray.open_zarr(folder)
    print(data)

# %% The area of the plume at every time
x, z, times = (np.asarray(data[name]) for name in ('x', 'z', 'time'))
plume = np.nan_to_num(np.asarray(data['concentration'])) > 0.5
area_cm2 = 1e4 * plume.sum(axis=(1, 2)) * (x[1] - x[0]) * (z[1] - z[0])
print(f'plume after {times[-1]:.0f} s: {area_cm2[-1]:.0f} cm2')

# %% Picture
figure, axis = plt.subplots(figsize=(6, 3.4), layout='constrained')
axis.plot(times, area_cm2, marker='o')
axis.set(title='plume of the sample bag', xlabel='time [s]', ylabel='area above 0.5 [cm2]')
figure.savefig(picture_path(__file__), dpi=80)
assert (np.diff(area_cm2) > 0).all()
assert float(np.asarray(data['commanded_rate'])[0].max()) == 500.0
