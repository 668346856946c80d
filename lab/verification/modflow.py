"""MODFLOW 6 beside the solver: flopy writes its input from a rig of ours, and reads its maps.

It needs flopy, and the program `mf6` in the path. The grid, wells and water at the sides are ours;
flow, density (package BUY) and transport (scheme TVD) are those of MODFLOW 6.
"""

import importlib.util
import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects import described_physics
from porotwin_solver.transport.sources_and_sinks import SourcesAndSinks

PROGRAM = 'mf6'
CLOSED = {'flow': (1e-8, 1e-5), 'salt': (1e-5, 1e-5)}
"""Change and residual at which the iterations of each model end: of heads [m] and water [m^3/s], of
concentrations [-] and stock [m^3/s]."""

DEEPER = 1e6
"""The plates are written so many times as far apart, with rates as much larger: the residuals of
MODFLOW 6 are absolute, and meant for aquifers."""

Places = list[list[Any]]
"""Lines of a package of MODFLOW 6: the cell, numbers, and the concentration."""


def missing() -> str:
    """Return the part of MODFLOW 6 that is missing here; empty if none is."""
    if importlib.util.find_spec('flopy') is None:
        return 'flopy is not installed'
    return '' if shutil.which(PROGRAM) else f'{PROGRAM} is not in the path'


def modflow_maps(
    rig: Rig, schedule: Schedule, times: Sequence[float], *, grid: Grid, longest_step: float
) -> FloatArray:
    """Return the maps at `times` [s] by MODFLOW 6, (nt, nz, nx), row 0 at the bottom.

    No time step is longer than `longest_step` [s].

    Raises:
        InputError: MODFLOW 6 is missing or fails, or the rig has other parts.
    """
    with tempfile.TemporaryDirectory() as folder:
        return prepared_maps(
            rig, schedule, times, grid=grid, longest_step=longest_step, folder=Path(folder)
        )()


def prepared_maps(
    rig: Rig,
    schedule: Schedule,
    times: Sequence[float],
    *,
    grid: Grid,
    longest_step: float,
    folder: Path,
) -> Callable[[], FloatArray]:
    """Write the input of `modflow_maps` into `folder`; return the rest of its work.

    Raises:
        InputError: as `modflow_maps`, also from the work.
    """
    if reason := missing():
        raise InputError(f'MODFLOW 6: {reason}')
    physics = described_physics(rig, grid, ())
    _refuse(physics)
    ends = sorted({*times, *(row.time for row in schedule.rows)} - {0.0})
    simulation = _written(physics, schedule, ends, longest_step, folder)

    def run() -> FloatArray:
        # not by flopy, which does not wait for it: its processor time would be lost
        done = subprocess.run([PROGRAM], check=False, cwd=folder, capture_output=True, text=True)
        if done.returncode or 'Normal termination' not in done.stdout:
            raise InputError(f'MODFLOW 6 fails: {"; ".join(done.stdout.splitlines()[-3:])}')
        found = simulation.get_model('salt').output.concentration()
        return np.array([found.get_data(totim=time)[::-1, 0] for time in times])

    return run


def _refuse(physics: Physics) -> None:
    """Raise InputError if the rig has parts that are not written."""
    known = (
        physics.contact.canal is None
        and physics.fringe is None
        and not (physics.levels or physics.leaks or physics.immobile_fraction)
        and (physics.viscosity_ratio, physics.retardation_factor) == (1.0, 1.0)
        and physics.decay_rate == 0.0
    )
    if not known:
        raise InputError(
            'MODFLOW 6 is written for full sand, wells and water at the sides, with density and '
            'dispersion; remove the rest'
        )


def _written(
    physics: Physics, schedule: Schedule, ends: Sequence[float], longest_step: float, folder: Path
) -> Any:
    """Return the simulation of flopy, with its files in `folder`; periods end at `ends` [s]."""
    import flopy.mf6 as mf6

    simulation = mf6.MFSimulation('twin', exe_name=PROGRAM, sim_ws=str(folder))
    lengths = np.diff([0.0, *ends])
    periods = [(float(one), math.ceil(one / longest_step), 1.0) for one in lengths]
    mf6.ModflowTdis(simulation, nper=len(periods), perioddata=periods, time_units='seconds')
    flow = mf6.ModflowGwf(simulation, modelname='flow', save_flows=True)
    salt = mf6.ModflowGwt(simulation, modelname='salt')
    for model in (flow, salt):
        change, residual = CLOSED[model.name]
        solver = mf6.ModflowIms(
            simulation,
            filename=f'{model.name}.ims',
            linear_acceleration='BICGSTAB',
            outer_maximum=200,
            inner_maximum=300,
            outer_dvclose=change,
            inner_dvclose=change,
            rcloserecord=residual,
        )
        simulation.register_ims_package(solver, [model.name])
    mf6.ModflowGwfdis(flow, **_cells(physics))
    mf6.ModflowGwtdis(salt, **_cells(physics))
    conductivity = physics.permeability * physics.density * GRAVITY / physics.viscosity
    mf6.ModflowGwfnpf(flow, k=_layers(conductivity), icelltype=0)
    mf6.ModflowGwfic(flow, strt=physics.contact.lowest + physics.contact.highest)
    mf6.ModflowGwfbuy(
        flow,
        denseref=physics.density,
        packagedata=[(0, physics.density_difference, 0.0, 'salt', 'CONCENTRATION')],
    )
    heads, rates, held = _at_sides(physics, conductivity)
    wells = {
        period: [*rates, *_wells(physics, schedule, begin)]
        for period, begin in enumerate([0.0, *ends[:-1]])
    }
    sources = []
    if heads:
        mf6.ModflowGwfghb(
            flow,
            stress_period_data=heads,
            auxiliary=['CONCENTRATION', 'ELEVATION'],
            pname='heads',
            maxbound=len(heads),
        )
        sources.append(('heads', 'AUX', 'CONCENTRATION'))
    if most := max(len(lines) for lines in wells.values()):
        mf6.ModflowGwfwel(
            flow,
            stress_period_data=wells,
            auxiliary=['CONCENTRATION'],
            pname='rates',
            maxbound=most,
        )
        sources.append(('rates', 'AUX', 'CONCENTRATION'))
    if held:
        mf6.ModflowGwtcnc(salt, stress_period_data=held, maxbound=len(held))
    mf6.ModflowGwtmst(salt, porosity=_layers(physics.porosity))
    mf6.ModflowGwtic(salt, strt=0.0)
    mf6.ModflowGwtadv(salt, scheme='TVD')
    along, across = physics.longitudinal_dispersivity, physics.transverse_dispersivity
    mf6.ModflowGwtdsp(salt, alh=along, ath1=across, alv=along, atv=across, diffc=physics.diffusion)
    mf6.ModflowGwtssm(salt, sources=sources)
    mf6.ModflowGwtoc(
        salt, concentration_filerecord='salt.ucn', saverecord=[('CONCENTRATION', 'LAST')]
    )
    mf6.ModflowGwfgwt(simulation, exgtype='GWF6-GWT6', exgmnamea='flow', exgmnameb='salt')
    simulation.write_simulation(silent=True)
    return simulation


def _cells(physics: Physics) -> dict[str, Any]:
    """Return the cells in the words of MODFLOW 6: layers from above, one row of the depth."""
    grid = physics.grid
    depth = float(physics.depth.mean())
    if not np.allclose(physics.depth, depth):
        raise InputError('MODFLOW 6 is written for plates at one distance')
    bottoms = grid.height - grid.dz * np.arange(1, grid.nz + 1)
    return {
        'nlay': grid.nz,
        'nrow': 1,
        'ncol': grid.nx,
        'delr': grid.dx,
        'delc': DEEPER * depth,
        'top': grid.height,
        'botm': bottoms.tolist(),
        'length_units': 'meters',
    }


def _layers(values: FloatArray) -> FloatArray:
    """Return a map (nz, nx), row 0 at the bottom, as layers from above with one row."""
    return values[::-1, None]


def _at_sides(physics: Physics, conductivity: FloatArray) -> tuple[Places, Places, Places]:
    """Return the heads, the rates and the concentrations that water holds at the sides."""
    grid, contact = physics.grid, physics.contact
    heads: Places = []
    rates: Places = []
    held: Places = []
    through = {
        'left': (grid.dz / grid.dx, grid.z),
        'right': (grid.dz / grid.dx, grid.z),
        'bottom': (grid.dx / grid.dz, np.zeros(grid.nx)),
        'top': (grid.dx / grid.dz, np.full(grid.nx, grid.height)),
    }
    for side, (shape, heights) in through.items():
        for place in range(len(heights)):
            layer, column = _place(side, place, grid)
            cell = (layer, 0, column)
            stock = float(getattr(contact.concentration, side)[place])
            share = float(getattr(contact.open, side)[place])
            row = grid.nz - 1 - layer
            if share:
                half = 2.0 * DEEPER * conductivity[row, column] * physics.depth[row, column] * shape
                head = contact.lowest + float(getattr(contact.head, side)[place])
                heads.append([cell, head, share * half, stock, float(heights[place])])
            rain = float(getattr(contact.rain, side)[place])
            if rain:
                rates.append([cell, DEEPER * rain, stock])
            if getattr(contact.diffuses, side)[place]:
                held.append([cell, stock])
    return heads, rates, held


def _place(side: str, place: int, grid: Grid) -> tuple[int, int]:
    """Return the layer and the column of a face of a side; layers count from above."""
    if side in ('left', 'right'):
        return grid.nz - 1 - place, 0 if side == 'left' else grid.nx - 1
    return 0 if side == 'top' else grid.nz - 1, place


def _wells(physics: Physics, schedule: Schedule, time: float) -> Iterator[list[Any]]:
    """Yield the rates of wells in the cells from `time` [s] on."""
    inflow, tracer, outflow = SourcesAndSinks(physics).sources(schedule.at(time))
    layers = physics.grid.nz - 1
    for row, column in np.argwhere(inflow + outflow > 0.0).tolist():
        water, out = float(inflow[row, column]), float(outflow[row, column])
        cell = (layers - row, 0, column)
        if water:
            yield [cell, DEEPER * water, float(tracer[row, column]) / water]
        if out:
            yield [cell, -DEEPER * out, 0.0]
