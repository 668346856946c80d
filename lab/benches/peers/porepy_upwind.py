"""PorePy on the case of `bench_solver`: TPFA, implicit upwind transport, the sparse LU of SciPy."""

from collections.abc import Callable

import numpy as np
import porepy as pp
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu

from lab.benches.peers.child import Problem
from lab.benches.peers.flow_problem import cell_rates


def version() -> str:
    """Return the version of PorePy."""
    return str(pp.__version__)


def prepare(problem: Problem) -> Callable[[], NDArray[np.float64]]:
    """Return the work: the maps (times, nz, nx) that `flow_problem` describes."""
    nz, nx = problem['mobility_thickness'].shape
    size = np.array([nx * problem['dx'], nz * problem['dz']])
    grid = pp.CartGrid(np.array([nx, nz]), size)
    grid.compute_geometry()
    top = np.flatnonzero(grid.face_centers[1] > size[1] - 0.25 * problem['dz'])
    outside = {
        'bc': pp.BoundaryCondition(grid, top, ['dir'] * len(top)),
        'bc_values': np.zeros(grid.num_faces),
    }
    tensor = pp.SecondOrderTensor(problem['mobility_thickness'].ravel())
    data = pp.initialize_data({}, 'flow', {**outside, 'second_order_tensor': tensor})
    pp.initialize_data(data, 'transport', outside)
    flow, upwind = pp.Tpfa('flow'), pp.Upwind('transport')
    capacity = problem['storage'].ravel() / float(problem['interval'])

    def work() -> NDArray[np.float64]:
        flow.discretize(grid, data)
        matrix, _ = flow.assemble_matrix_rhs(grid, data)
        pressure = splu(csc_matrix(matrix))
        flux = data[pp.DISCRETIZATION_MATRICES]['flow'][flow.flux_matrix_key]
        state, maps = np.zeros(nz * nx), []
        for frame, (inflow, tracer, outflow) in enumerate(cell_rates(problem), 1):
            through = flux @ pressure.solve(inflow - outflow)
            data[pp.PARAMETERS]['transport']['darcy_flux'] = through
            upwind.discretize(grid, data)
            carried, _ = upwind.assemble_matrix_rhs(grid, data)
            step = splu(csc_matrix(carried + diags(capacity + outflow)))
            state = step.solve(capacity * state + tracer)
            if frame in problem['frames']:
                maps.append(state.reshape(nz, nx))
        return np.array(maps)

    return work
