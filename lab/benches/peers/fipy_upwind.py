"""FiPy on the case of `bench_solver`: its default solvers, implicit upwind transport."""

from collections.abc import Callable

import fipy
import numpy as np
from fipy import (
    CellVariable,
    DiffusionTerm,
    FaceVariable,
    Grid2D,
    ImplicitSourceTerm,
    TransientTerm,
    UpwindConvectionTerm,
)
from numpy.typing import NDArray

from lab.benches.peers.child import Problem
from lab.benches.peers.flow_problem import cell_rates


def version() -> str:
    """Return the version of FiPy."""
    return str(fipy.__version__)


def prepare(problem: Problem) -> Callable[[], NDArray[np.float64]]:
    """Return the work: the maps (times, nz, nx) that `flow_problem` describes."""
    nz, nx = problem['mobility_thickness'].shape
    mesh = Grid2D(dx=float(problem['dx']), dy=float(problem['dz']), nx=nx, ny=nz)
    area = float(problem['dx'] * problem['dz'])
    mobility_thickness = float(problem['mobility_thickness'][0, 0])
    pressure = CellVariable(mesh=mesh)
    pressure.constrain(0.0, mesh.facesTop)
    tracer = CellVariable(mesh=mesh, hasOld=True)
    source, injected, produced = (CellVariable(mesh=mesh) for _ in range(3))
    velocity = FaceVariable(mesh=mesh, rank=1)
    flow = DiffusionTerm(coeff=mobility_thickness) + source == 0.0
    capacity = float(problem['storage'][0, 0]) / area
    transport = TransientTerm(coeff=capacity) + UpwindConvectionTerm(coeff=velocity) == (
        injected - ImplicitSourceTerm(coeff=produced)
    )

    def work() -> NDArray[np.float64]:
        maps = []
        for frame, (inflow, stock, outflow) in enumerate(cell_rates(problem), 1):
            source.setValue((inflow - outflow) / area)
            injected.setValue(stock / area)
            flow.solve(var=pressure)
            velocity.setValue(-mobility_thickness * pressure.faceGrad)
            through_top = (mesh.facesTop * velocity).divergence.value
            produced.setValue(outflow / area + np.maximum(through_top, 0.0))  # outer faces are shut
            tracer.updateOld()
            transport.solve(var=tracer, dt=float(problem['interval']))
            if frame in problem['frames']:
                maps.append(tracer.value.reshape(nz, nx).copy())
        return np.array(maps)

    return work
