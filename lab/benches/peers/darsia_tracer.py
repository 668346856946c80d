"""DarSIA on the photographs of `bench_imaging`: its corrections, and its analysis of a tracer.

The chart corrects the colours, and the corners of the rig crop the picture. The picture becomes as
coarse as the map before the analysis, because total variation of all pixels takes minutes.

| array | shape | meaning |
| --- | --- | --- |
| `baseline`, `state` | (bytes) | the files without and with tracer |
| `corners`, `chart` | (4, 2) | column and row from the upper left, counter-clockwise [px] |
| `size` | (2) | width and height of the rig [m] |
| `shape` | (2) | rows and columns of the map |
| `rounds` | | how many times the photograph becomes a map |
"""

import importlib.metadata
from collections.abc import Callable

import darsia
import numpy as np
from numpy.typing import NDArray

from lab.benches.peers.child import Problem


def version() -> str:
    """Return the version of DarSIA."""
    return importlib.metadata.version('darsia')


def prepare(problem: Problem) -> Callable[[], NDArray[np.float64]]:
    """Return the work: the signal (nz, nx), row 0 at the bottom, of the photograph."""
    width, height = (float(size) for size in problem['size'])
    corners, chart = (
        darsia.make_voxel(problem[name][:, ::-1].round().astype(int))
        for name in ('corners', 'chart')
    )
    crop = {'pts_src': corners, 'width': width, 'height': height, 'in meters': True}
    corrections = [
        darsia.ColorCorrection(config={'roi': chart}),
        darsia.CurvatureCorrection(config={'crop': crop}),
    ]
    smaller = darsia.Resize(shape=tuple(problem['shape'].tolist()), interpolation='inter_area')

    def cells(name: str) -> darsia.Image:
        photograph = darsia.imread_from_bytes(
            problem[name].tobytes(), transformations=corrections, width=width, height=height
        )
        return smaller(photograph).img_as(np.float64)

    analysis = darsia.ConcentrationAnalysis(
        base=cells('baseline'),
        signal_reduction=darsia.MonochromaticReduction(color='gray'),
        restoration=darsia.TVD(),
        **{'diff option': 'negative', 'restoration -> model': True},
    )

    def work() -> NDArray[np.float64]:
        for _ in range(int(problem['rounds'])):
            found = analysis(cells('state'))
        return np.asarray(found.img)[::-1]

    return work
