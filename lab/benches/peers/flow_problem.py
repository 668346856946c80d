"""The case of `bench_solver` in arrays, for peers that know nothing of our rigs.

| array | shape | meaning |
| --- | --- | --- |
| `dx`, `dz` | | sizes of a cell [m] |
| `mobility_thickness`, `storage` | (nz, nx) | as in `Physics`; row 0 is the bottom |
| `interval` | | time between two changes of the rates, and longest step [s] |
| `cells` | (n) | flat places of the cells with wells |
| `inflow`, `tracer`, `outflow` | (intervals, n) | water, stock from wells; water to them [m^3/s] |
| `frames` | (m) | places of the wanted maps (m, nz, nx): intervals until then |

The top is open with a head of zero; the other sides are closed.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lab.benches.peers.child import Problem

CellRates = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def cell_rates(problem: Problem) -> Iterator[CellRates]:
    """Yield inflow, tracer and outflow of all cells, flat [m^3/s], for each interval."""
    for rates in zip(problem['inflow'], problem['tracer'], problem['outflow'], strict=True):
        inflow, tracer, outflow = (np.zeros(problem['storage'].size) for _ in rates)
        for all_cells, some in zip((inflow, tracer, outflow), rates, strict=True):
            all_cells[problem['cells']] = some
        yield inflow, tracer, outflow
