"""Export the sample bag as zarr and go on with it as in a notebook: the cells begin with `# %%`.

xarray opens the folder (`pip install xarray zarr`). Where it is not installed, the NetCDF library
of PoroTwin reads the same arrays.
"""

# %% Export: the same as ./porotwin export bags/sample sample.zarr --format zarr
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import netCDF4
import numpy as np
from picture import picture_path

from porotwin_recording.dataset_export import export_dataset
from porotwin_recording.recording import open_recording

BAG = Path(__file__).parents[1] / 'bags' / 'sample'
folder = Path(tempfile.mkdtemp()) / 'sample.zarr'
export_dataset(open_recording(BAG), folder, 'zarr')

# %% Open
try:
    import xarray
except ImportError:
    opened = netCDF4.Dataset(f'file://{folder}#mode=zarr,file')
    data = {name: np.ma.filled(opened[name][:], np.nan) for name in ('time', 'z', 'x')}
    data['concentration'] = np.ma.filled(opened['concentration'][:], np.nan)
    data['commanded_rate'] = np.ma.filled(opened['commanded_rate'][:])
else:
    data = xarray.open_zarr(folder)
    print(data)

# %% The centre of the plume at every time
plume = np.nan_to_num(np.asarray(data['concentration']))
plume = np.where(plume > 0.05, plume, 0.0)  # the noise of clear water does not count
height = np.asarray(data['z'])
weight = plume.sum(axis=2)
times, seen = np.asarray(data['time']), weight.sum(axis=1) > 0
centre_m = (weight @ height)[seen] / weight.sum(axis=1)[seen]
print(f'centre of the plume after {times[-1]:.0f} s: {100 * centre_m[-1]:.1f} cm above the bottom')

# %% Picture
figure, axes = plt.subplots(figsize=(6, 3), layout='constrained')
axes.plot(times[seen], 100 * centre_m, marker='o')
axes.set(xlabel='time [s]', ylabel='centre of the plume [cm above the bottom]')
figure.savefig(picture_path(__file__))
assert 0.0 < centre_m[-1] < height[-1]
assert float(np.asarray(data['commanded_rate'])[0].max()) == 500.0
