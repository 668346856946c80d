"""Writes the maps of a recording for ParaView: one image of VTK for each time, and their times."""

from pathlib import Path

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.whole_folder import whole_folder
from porotwin_recording.experiment.recording import Recording

SERIES = 'maps.pvd'
"""The file to open in ParaView: it names the images with their times [s]."""


def export_vtk(recording: Recording, folder: Path) -> None:
    """Write the maps of a recording; `folder` appears when it is complete.

    z points upward, and y through the rig. Cells are the ones of the maps, over a depth of one
    cell. They hold `concentration`, and `deviation` if it is known; NaN where nothing is seen.

    Args:
        recording: the recording.
        folder: the folder to write.

    Raises:
        InputError: `folder` exists, the recording holds no maps, or pyevtk is not installed.
        OSError: the disk is full or fails.
    """
    try:
        from pyevtk.hl import imageToVTK
        from pyevtk.vtk import VtkGroup
    except ModuleNotFoundError as error:
        raise InputError(f'{error}; pip install pyevtk') from error
    if folder.exists():
        raise InputError(f'{folder}: exists already; name another or remove it')
    grid, maps = recording.grid, recording.present_maps
    spacing = (grid.dx, grid.dx, grid.dz)
    with whole_folder(folder) as unfinished:
        series = VtkGroup(str(unfinished / Path(SERIES).stem))
        for number, (time, fields) in enumerate(
            zip(recording.times, maps.with_deviations(), strict=True)
        ):
            named = zip(('concentration', 'deviation'), fields, strict=False)
            cells = {
                name: np.asfortranarray(values.T[:, None, :])
                for name, values in named
                if values is not None
            }
            image = imageToVTK(
                str(unfinished / f'map_{number:05d}'), spacing=spacing, cellData=cells
            )
            series.addFile(image, float(time))
        series.save()
