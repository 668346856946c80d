"""Maps for ParaView, read back byte by byte as the format of VTK says."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('pyevtk', reason='needs pyevtk; pip install pyevtk')

from porotwin_core.basis.errors import InputError
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.experiment.vtk_export import SERIES, export_vtk

BAG = Path(__file__).parents[2] / 'bags' / 'sample'


def test_an_image_holds_the_map_of_its_time(tmp_path: Path) -> None:
    recording = open_recording(BAG)
    folder = tmp_path / 'vtk'
    export_vtk(recording, folder)
    parts = ET.parse(folder / SERIES).getroot().findall('.//DataSet')
    assert [float(part.attrib['timestep']) for part in parts] == list(recording.times)
    head, _, data = (folder / parts[-1].attrib['file']).read_bytes().partition(b'\n_')
    (image,) = ET.fromstring(head + b'</AppendedData></VTKFile>').iter('ImageData')
    grid = recording.grid
    assert image.attrib['WholeExtent'].split() == ['0', f'{grid.nx}', '0', '1', '0', f'{grid.nz}']
    assert list(map(float, image.attrib['Spacing'].split())) == [grid.dx, grid.dx, grid.dz]
    size = int(np.frombuffer(data[:8], np.uint64)[0])
    values = np.frombuffer(data[8 : 8 + size], np.float32).reshape(grid.shape)
    np.testing.assert_array_equal(values, recording.concentration[-1])
    with pytest.raises(InputError, match='exists already'):
        export_vtk(recording, folder)
