"""The picture of an example: where it goes, and how it shows a map of the rig.

It goes to the folder in the first argument, or to examples/pictures/NAME.png.
"""

import sys
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.image import AxesImage

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import Rig

matplotlib.use('Agg')


def picture_path(script: str) -> Path:
    """Return the path of the picture of `script`, in a folder that exists."""
    name = f'{Path(script).stem}.png'
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(script).parent / 'pictures'
    folder.mkdir(parents=True, exist_ok=True)
    return folder / name


def draw_map(axis: Axes, rig: Rig, values: FloatArray, title: str, **style: Any) -> AxesImage:
    """Draw a map (nz, nx) over the rig with its wells; return the image for a colour bar.

    `style` goes to `imshow`; without it the colours cover the concentrations 0 to 1.
    """
    extent = (0.0, rig.width_m, 0.0, rig.height_m)
    colours = {'vmin': 0.0, 'vmax': 1.0, **style}
    image = axis.imshow(values, origin='lower', extent=extent, **colours)
    for well in rig.wells.values():
        axis.plot(well.x_m, well.z_m, 'o', markersize=4, color='white', markeredgecolor='black')
    axis.set(title=title, xlabel='x [m]', ylabel='z [m]')
    return image
