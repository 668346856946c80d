"""The problems of rigs/verification: each is run as `simulate` runs it, and measured."""

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from lab.verification.modflow import missing, modflow_maps
from lab.verification.solutions import (
    continuous_source,
    discharge_of_a_part,
    henry,
    push_and_pull,
)
from porotwin_core.basis.units import GRAVITY, ML_H, from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rig import Rig
from porotwin_core.rig.description import PropertyName
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_solver.effects import parse_effect
from porotwin_solver.flow.background_flux import background_flux
from porotwin_solver.model.engine import State
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate

FOLDER = Path(__file__).resolve().parents[2] / 'rigs' / 'verification'

SEEN = 'seen.csv'
"""The wedges of the sand tank as they were photographed: state, distance and height [cm]."""

TANK_STATES = {'SS-1': (0.0, 1.42), 'SS-2': (-0.005, 0.59), 'SS-3': (-0.0015, 1.19)}
"""Rise of the fresh water's level [m], and the measured flow [cm3/s] (Goswami and Clement 2007)."""

PANELS_S = (2581.0, 5162.0, 10311.0, 12904.0, 15485.0, 18053.0, 20634.0, 23215.0)
"""Times of the published pictures of the salt lake [s]."""

FINGER = 0.25
"""Salt of a finger: a quarter of the rise to saturation."""

Figures = dict[str, float]
"""The errors, each by a name with its unit in brackets."""


@dataclass(frozen=True)
class Problem:
    """A problem with a known answer.

    Attributes:
        name: its folder in `FOLDER`.
        title: in words.
        source: of the problem or of its answer.
        cell_m: size of the cells of the page [m].
        options: of `simulate` beside the grid.
        measure: the errors on one grid.
        beside: times of the maps that MODFLOW 6 computes too [s], and its longest step [s].
    """

    name: str
    title: str
    source: str
    cell_m: float
    options: str
    measure: Callable[['Problem', Recording, Grid], Figures]
    beside: tuple[Sequence[float], float] | None = None

    def errors(self, cell_m: float = 0.0) -> Figures:
        """Return the errors with cells of `cell_m` [m], or with those of the page."""
        recording = open_recording(FOLDER / self.name)
        grid = recording.rig.default_grid(cell_m or self.cell_m)
        coarse = recording.rig.default_grid(2.0 * (cell_m or self.cell_m))
        return self.measure(self, recording, grid) | self._beside_modflow(recording, coarse)

    def _beside_modflow(self, recording: Recording, grid: Grid) -> Figures:
        """Return how far the maps lie from those of MODFLOW 6; nothing where it is missing."""
        if self.beside is None or missing():
            return {}
        times, step = self.beside
        own = _maps(recording, grid, times)
        rig, rates = recording.rig, recording.schedule
        theirs = modflow_maps(rig, rates, times, grid=grid, longest_step=step)
        apart = np.abs(own - theirs).mean() / theirs.mean()
        return {'MODFLOW 6 [%]': _percent(float(apart))}

    @property
    def words(self) -> str:
        """The words of a user after `simulate rigs/verification/`."""
        grid = open_recording(FOLDER / self.name).rig.default_grid(self.cell_m)
        return f'{self.name} --grid {grid}{self.options}'


def uniform_flow(_: Problem, recording: Recording, grid: Grid) -> Figures:
    """Return the error of the map at the end, without the cells at the source."""
    (found,), time = _maps(recording, grid), recording.schedule.rows[-1].time
    rig = recording.rig
    well, rate = rig.wells['source'], recording.schedule.rows[0].rate.rate
    porosity, depth = _of(rig, 'porosity'), _of(rig, 'depth_m')
    x, z = grid.x[None, :] - well.x_m, grid.z[:, None] - well.z_m
    exact = continuous_source(
        x,
        z,
        time,
        rate=rate / (porosity * depth),
        velocity=_conductivity(rig) * _gradient(rig) / porosity,
        dispersivities=_dispersivities(rig),
    )
    apart = np.hypot(x, z) > _dispersivities(rig)[0]
    wrong = np.abs(found - exact)[apart]
    return {
        'map [%]': _percent(float(wrong.sum() / exact[apart].sum())),
        'worst cell [%]': _percent(float(wrong.max() / exact[apart].max())),
    }


def push_pull(_: Problem, recording: Recording, grid: Grid) -> Figures:
    """Return the errors of the maps after the injection and halfway through the withdrawal."""
    rig, rows = recording.rig, recording.schedule.rows
    well = rig.wells['well']
    pushed, pulled = rows[1].time, 0.5 * (rows[2].time - rows[1].time)
    maps = _maps(recording, grid, [pushed, pushed + pulled])
    strength = rows[0].rate.rate / (2.0 * math.pi * _of(rig, 'depth_m') * _of(rig, 'porosity'))
    spread = _dispersivities(rig)[0]
    edges = np.arange(well.radius_m, 0.5 * rig.width_m, spread / 30.0)
    exact = push_and_pull(edges, (pushed, pulled), strength=strength, dispersivity=spread)
    radius = np.hypot(grid.x[None, :] - well.x_m, grid.z[:, None] - well.z_m)
    apart = radius > spread
    names = 'map, injected [%]', 'map, withdrawn [%]'
    errors: Figures = {}
    for name, found, rings in zip(names, maps, exact, strict=True):
        expected = np.interp(radius, 0.5 * (edges[1:] + edges[:-1]), rings, right=0.0)
        wrong = np.abs(found - expected)[apart]
        errors[name] = _percent(float(wrong.sum() / expected[apart].sum()))
    return errors


def henrys(problem: Problem, recording: Recording, grid: Grid) -> Figures:
    """Return the errors of the steady map beside both conditions at the sea.

    With salt that diffuses in, the cells are twice as large: the same errors take much longer.
    """
    rig = recording.rig
    rate = from_ml_h(rig.water['land'].rate_ml_h or 0.0) / _of(rig, 'depth_m')
    weight = _parameter(rig, 'buoyancy', 'density_difference') / rig.density_kg_m3
    speed = _conductivity(rig) * weight
    spread = _parameter(rig, 'dispersion', 'diffusion') * _of(rig, 'porosity')
    errors: Figures = {}
    coarse = rig.grid(grid.nx // 2, grid.nz // 2)
    for diffuses, name, cells in ((False, '', grid), (True, ', Henry', coarse)):
        sea = rig.water['sea'].model_copy(update={'diffuses': diffuses})
        described = rig.model_copy(update={'water': {**rig.water, 'sea': sea}})
        (found,) = _maps(replace(recording, rig=described), cells, [_end(problem)])
        x, z, c = henry(
            rate / (speed * rig.height_m),
            spread / rate,
            rig.width_m / rig.height_m,
            counts=(30, 20),
            sea_diffuses=diffuses,
        )
        along = BarycentricInterpolator(x * rig.height_m, c.T)(cells.x)
        exact = BarycentricInterpolator(z * rig.height_m, along.T)(cells.z)
        toe = _crossing(found[0], cells) - _crossing(exact[0], cells)
        wrong = float(np.abs(found - exact).mean())
        errors |= {f'cells{name} [%]': _percent(wrong), f'toe{name} [cm]': 100.0 * toe}
    return errors


def dam(_: Problem, recording: Recording, grid: Grid) -> Figures:
    """Return the errors of the rate without rain, and of the table with it."""
    rig = recording.rig
    high, low = (rig.water[name].head_m or 0.0 for name in ('high', 'low'))
    conductivity, depth = _conductivity(rig), _of(rig, 'depth_m')
    dry = Model(rig, grid, preset='fast', effects=[parse_effect('water_body:body=rain,factor=0')])
    rate = float(dry.engine.water_flux({}).x[:, 0].sum())
    charny = conductivity * depth * (high**2 - low**2) / (2.0 * rig.width_m)
    table = Model(rig, grid, preset='fast').engine.table({})
    height = table.surface.sum(axis=0) * table.physics.grid.dz
    rain = (rig.water['rain'].rate_ml_h or 0.0) * ML_H / (rig.width_m * depth)
    x = table.physics.grid.x
    slope = (high**2 - low**2) / rig.width_m
    square = high**2 - slope * x + rain / conductivity * x * (rig.width_m - x)
    worst = 1e3 * float(np.abs(height - np.sqrt(square)).max())
    return {'rate, no rain [%]': _percent(rate / charny - 1.0), 'table [mm]': worst}


def ditch(_: Problem, recording: Recording, grid: Grid) -> Figures:
    """Return the error of the rate."""
    rig = recording.rig
    flux = background_flux(Model(rig, grid, preset='fast').engine.physics)
    assert flux is not None
    found = float(flux.x[:, -1].sum())
    fall = (rig.water['ditch'].head_m or 0.0) - (rig.water['low'].head_m or 0.0)
    share = (rig.water['ditch'].to_m or 0.0) / rig.height_m
    form = discharge_of_a_part(rig.width_m, rig.height_m, share)
    exact = form * _conductivity(rig) * fall * _of(rig, 'depth_m')
    return {'rate [%]': _percent(found / exact - 1.0)}


def glover(problem: Problem, recording: Recording, grid: Grid) -> Figures:
    """Return the error of the depth of the interface, c = 0.5, between shore and toe."""
    rig = recording.rig
    (found,) = _maps(recording, grid, [_end(problem)])
    rate = from_ml_h(rig.water['land'].rate_ml_h or 0.0) / _of(rig, 'depth_m')
    weight = _parameter(rig, 'buoyancy', 'density_difference') / rig.density_kg_m3
    reach = rate / (_conductivity(rig) * weight)
    inland = grid.x - (rig.water['floor'].to_m or 0.0)
    toe = (rig.height_m**2 - reach**2) / (2.0 * reach)
    land = inland > 0.0
    depth = np.sqrt(2.0 * reach * inland[land] + reach**2)
    under = depth < rig.height_m
    salt = found[:, land][:, under].sum(axis=0) * grid.dz
    wrong = float(np.abs(rig.height_m - salt - depth[under]).mean())
    seen_toe = _crossing(found[0], grid) - (rig.water['floor'].to_m or 0.0)
    return {
        'depth [cm]': 100.0 * wrong,
        'toe [cm]': 100.0 * (seen_toe - toe),
    }


def sand_tank(problem: Problem, recording: Recording, grid: Grid) -> Figures:
    """Return how far the wedge lies from the photographed one, and the flow beside the measured."""
    table = list(csv.DictReader((FOLDER / problem.name / SEEN).open(encoding='utf-8')))
    errors: Figures = {}
    for state, (rise, measured) in TANK_STATES.items():
        effects = [parse_effect(f'water_body:body=land,rise={rise}')]
        model = Model(recording.rig, grid, preset='accurate', effects=effects)
        engine = model.engine
        now = State.equilibrium(np.zeros(engine.grid.shape))
        engine.advance(now, {}, _end(problem))
        flux = engine.coupled_flux(engine.water_flux({}), {}, now.mobile)
        flow = -1e6 * float(flux.x[:, -1].sum())
        seen = [line for line in table if line['state'] == state]
        rows = [int(float(line['z_cm']) / 100.0 / engine.grid.dz) for line in seen]
        wedge = 100.0 * np.array([_crossing(now.mobile[row], engine.grid) for row in rows])
        gap = wedge - [float(line['x_cm']) for line in seen]
        errors |= {
            f'wedge, {state} [cm]': float(np.abs(gap).mean()),
            f'toe, {state} [cm]': float(gap[-1]),
            f'flow, {state} [%]': _percent(flow / measured - 1.0),
        }
    return errors


def salt_lake(_: Problem, recording: Recording, grid: Grid) -> Figures:
    """Return the number of fingers at first and at last, and how deep they are at first."""
    first, last = _maps(recording, grid, [PANELS_S[1], PANELS_S[-1]])
    deep = np.flatnonzero((first > FINGER).any(axis=1))
    return {
        'fingers, first': float(fingers(first, grid)),
        'fingers, last': float(fingers(last, grid)),
        'depth, first [mm]': 1e3 * (grid.height - float(grid.z[deep[0]])) if deep.size else 0.0,
    }


def fingers(found: FloatArray, grid: Grid) -> int:
    """Return how many separate parts are salt in the row at half of the depth of the salt."""
    deep = np.flatnonzero((found > FINGER).any(axis=1))
    row = found[(deep[0] + grid.nz) // 2] if deep.size else found[0]
    return int(np.count_nonzero(np.diff(np.append(False, row > FINGER).astype(int)) > 0))


def _end(problem: Problem) -> float:
    """Return the last time of the options of `simulate` [s]."""
    return float(problem.options.split(':')[1])


def _maps(recording: Recording, grid: Grid, times: Sequence[float] = ()) -> FloatArray:
    """Return the maps that `simulate` writes at `times` [s], or at the end of the rates."""
    moments = times or [recording.schedule.rows[-1].time]
    return simulate(recording.rig, recording.schedule, moments, grid=grid)


def _crossing(profile: FloatArray, grid: Grid) -> float:
    """Return x [m] where c is 0.5, the one nearest to the left."""
    low, high = (profile[:-1] - 0.5), (profile[1:] - 0.5)
    (at,) = np.nonzero(low * high <= 0.0)
    if not at.size:
        return 0.0
    k = int(at[0])
    share = low[k] / (low[k] - high[k]) if low[k] != high[k] else 0.0
    return float(grid.x[k] + share * grid.dx)


def _percent(error: float) -> float:
    return 100.0 * error


def _of(rig: Rig, quantity: PropertyName) -> float:
    """Return a property that is the same everywhere [SI]."""
    return float(np.mean(rig.nominal_map(quantity)))


def _conductivity(rig: Rig) -> float:
    """Return the hydraulic conductivity [m/s]."""
    return _of(rig, 'permeability_m2') * rig.density_kg_m3 * GRAVITY / rig.viscosity_pa_s


def _parameter(rig: Rig, effect: str, name: str) -> float:
    (described,) = (one for one in rig.effects if one.name == effect)
    return float(described.parameters[name])


def _dispersivities(rig: Rig) -> tuple[float, float]:
    return (
        _parameter(rig, 'dispersion', 'longitudinal_dispersivity'),
        _parameter(rig, 'dispersion', 'transverse_dispersivity'),
    )


def _gradient(rig: Rig) -> float:
    """Return the fall of the heads from left to right over the width [-]."""
    heads = rig.boundaries.heads_m or {}
    return (heads['left'] - heads['right']) / rig.width_m


PROBLEMS = (
    Problem(
        'uniform_flow',
        'a continuous source in a uniform flow',
        'Wilson and Miller 1978',
        0.005,
        '',
        uniform_flow,
        ((2433.0,), 12.0),
    ),
    Problem(
        'push_pull',
        'injection and withdrawal through one well',
        'Gelhar and Collins 1971, on fine rings',
        0.005,
        '',
        push_pull,
        ((1500.0, 2100.0), 6.0),
    ),
    Problem(
        'henry',
        "Henry's problem",
        'Simpson and Clement 2004',
        0.05,
        ' --times 0:60000:3000',
        henrys,
        ((60000.0,), 240.0),
    ),
    Problem('dam', 'water table in a dam', 'Charny 1951; Dupuit', 0.01, ' --times 0:3600:60', dam),
    Problem(
        'ditch',
        'flow from a part of a side',
        'Polubarinova-Kochina 1962',
        0.005,
        ' --times 0:3600:60',
        ditch,
    ),
    Problem('glover', 'wedge below the sea', 'Glover 1959', 0.01, ' --times 0:120000:6000', glover),
    Problem(
        'sand_tank',
        'photographed wedges',
        'Goswami and Clement 2007',
        0.01,
        ' --times 0:4800:60',
        sand_tank,
    ),
    Problem(
        'salt_lake',
        'a salt lake in a Hele-Shaw cell',
        'Wooding 1997: 6 or 7 fingers, then 2',
        0.00075,
        ' --times 0:24000:600',
        salt_lake,
    ),
)
"""The problems in the order of the page."""
