"""A recording as a dataset of variables with CF attributes, for notebooks and files.

Conventions: https://cfconventions.org
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_core.rig import Rig
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.recorded_data import RecordedData
from porotwin_solver.effects import tracer_storage

if TYPE_CHECKING:
    import xarray

CONVENTIONS = 'CF-1.11'

FIELDS = {
    'concentration': ('tracer concentration, 1 = stock, NaN = not seen', '1'),
    'deviation': ('standard deviation of the concentration', '1'),
    'systematic': ('part of the standard deviation that is the same at all times', '1'),
}

Maps = dict[str, NDArray[np.float32]]
"""Maps (times, nz, nx) by the name of their variable."""


@dataclass(frozen=True)
class Variable:
    """A variable of the dataset; without values it is a map for every time."""

    dimensions: tuple[str, ...]
    attributes: dict[str, str]
    values: NDArray[Any] | None = None


def about(rig: Rig, maps: ConcentrationMaps, source: str) -> dict[str, Any]:
    """Return the attributes of the whole dataset; `source` is the name of the recording."""
    return {
        'Conventions': CONVENTIONS,
        'title': f'tracer experiment on the rig {rig.name}',
        'source': source,
        'history': f'written by {PROGRAM}',
        'rig': rig.name,
        'viscosity_pa_s': rig.viscosity_pa_s,
        'density_kg_m3': rig.density_kg_m3,
        'calibration': maps.origin.calibration or 'not known',
    }


def variables(data: RecordedData, maps: ConcentrationMaps) -> dict[str, Variable]:
    """Return all variables of `data` with its `maps`; the maps have no values yet."""
    rig, grid = data.rig, maps.grid

    def of(values: Any, dimension: str, unit: str, meaning: str, **more: str) -> Variable:
        attributes = {'units': unit, 'long_name': meaning, **more}
        return Variable((dimension,), attributes, np.asarray(values))

    wells = list(rig.wells.values())
    now = 'time since the experiment began'
    found = {
        'time': of(maps.times, 'time', 's', now, standard_name='time', axis='T'),
        'z': of(grid.z, 'z', 'm', 'height of the cell centres', axis='Z', positive='up'),
        'x': of(grid.x, 'x', 'm', 'cell centres from the left', axis='X'),
        'well_name': Variable(
            ('well',), {'long_name': 'names of the wells'}, np.array(list(rig.wells), dtype=object)
        ),
        'well_x': of([w.x_m for w in wells], 'well', 'm', 'distance of the wells from the left'),
        'well_z': of([w.z_m for w in wells], 'well', 'm', 'height of the wells'),
        'pore_volume': Variable(
            ('z', 'x'),
            {'units': 'm3', 'long_name': 'stock in each cell per concentration'},
            tracer_storage(rig, grid),
        ),
        **_rates(data, maps),
    }
    present = {'concentration': maps, 'deviation': maps.deviation, 'systematic': maps.systematic}
    for name, (meaning, unit) in FIELDS.items():
        if present[name] is not None:
            found[name] = Variable(('time', 'z', 'x'), {'units': unit, 'long_name': meaning})
    return found


def _rates(data: RecordedData, maps: ConcentrationMaps) -> dict[str, Variable]:
    """Return the rates of all wells at the times of the maps, if the recording has them."""
    wells, found = list(data.rig.wells), {}
    for name, schedule in (('commanded', data.commanded), ('measured', data.measured)):
        if schedule is None:
            continue
        at_times = [schedule.at(float(time)) for time in maps.times]
        rates = [[to_ml_h(at[w].rate) if w in at else 0.0 for w in wells] for at in at_times]
        shares = [[at[w].concentration if w in at else 0.0 for w in wells] for at in at_times]
        for quantity, values, unit, meaning in (
            ('rate', rates, 'ml h-1', 'rate of the pump, positive injects'),
            ('concentration', shares, '1', 'concentration of the injected fluid, 1 = stock'),
        ):
            attributes = {'units': unit, 'long_name': f'{name} {meaning}'}
            found[f'{name}_{quantity}'] = Variable(('time', 'well'), attributes, np.array(values))
    return found


def maps_between(maps: ConcentrationMaps, first: int, last: int) -> Maps:
    """Return the maps from number `first` to before `last`."""
    series = {'concentration': maps, 'deviation': maps.deviation, 'systematic': maps.systematic}
    return {name: each[first:last] for name, each in series.items() if each is not None}


def as_xarray(data: RecordedData, maps: ConcentrationMaps, source: str) -> 'xarray.Dataset':
    """Return the dataset that `export` writes, with all maps in memory.

    Raises:
        InputError: xarray is not installed.
    """
    try:
        import xarray

        import porotwin_recording.experiment.dataset_accessor  # noqa: F401  dataset.porotwin
    except ModuleNotFoundError as error:
        raise InputError(f'{error}; pip install xarray') from error
    values = maps_between(maps, 0, len(maps.times))
    return xarray.Dataset(
        {
            name: (each.dimensions, values.get(name, each.values), each.attributes)
            for name, each in variables(data, maps).items()
        },
        attrs=about(data.rig, maps, source),
    )
