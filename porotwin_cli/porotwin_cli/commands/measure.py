"""./porotwin measure: a table of the plume in every map of a recording."""

import dataclasses
import statistics
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from porotwin_checks.checks.map_values import MOST_STOCK
from porotwin_cli.options.output_files import check_output, write_rows
from porotwin_cli.terminal import Json, print_json, print_table, say
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import percent
from porotwin_core.clock.stamps import SAME_MOMENT_S

if TYPE_CHECKING:
    from porotwin_core.geometry.grid import FloatArray, Grid
    from porotwin_core.rig import Rig
    from porotwin_recording.tables.concentration import ConcentrationMaps

SHOWN = (
    'time_s',
    'tracer_ml',
    'x_m',
    'z_m',
    'area_m2',
    'contour_m',
    'fingers',
    'distance_m',
    'seen',
)
"""Columns that are printed; the file and --json hold all."""
MOST_ROWS = 40
"""Most maps in a table on a terminal: about one screen."""


def command(
    maps: Annotated[Path, typer.Argument(help='Maps (.nc), experiment folder or MCAP bag.')],
    rig: Annotated[
        Path | None,
        typer.Option(help='rig.yaml. Default: of the recording, or beside the file of maps.'),
    ] = None,
    output: Annotated[Path | None, typer.Option(help='Table to write, CSV.')] = None,
    level: Annotated[float, typer.Option(help='Concentration of the outline.')] = 0.1,
    side: Annotated[
        str, typer.Option(help='Side on which fingers are counted: down, up, left or right.')
    ] = 'down',
    against: Annotated[
        Path | None,
        typer.Option(help='Other maps for the distances. Default: the previous map.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure the plume in every map: tracer, centre, spread, area, outline, fingers, distance.

    The distance [m] is the Wasserstein distance of the normalised maps to the previous map, or to
    the map of --against at the same time. Tracer, centre, spread and distance use the plume and
    3 cm around it, to leave out the noise of clean sand. A map with noise alone has no tracer.

    A finger is a bulge of the front on one side. A separate plume counts as a finger. The file and
    --json hold standard deviations if the maps have them.

    Example: ./porotwin measure maps.nc --rig rig.yaml --output plume.csv
    """
    if output is not None:
        check_output(output, maps, against, rig or _rig_beside(maps))
    description, found = _maps(maps, rig)
    other = None if against is None else _maps(against, rig or _rig_beside(maps))[1]
    if other is not None and other.grid != found.grid:
        raise InputError(
            f'{against}: its grid is {other.grid}, that of {maps} is {found.grid}; '
            'image both with the same --grid'
        )
    rows = _rows(description, found, other, level, side)
    if other is not None and all(_at(other, float(time)) is None for time in found.times):
        say(
            f'{against}: no map within {SAME_MOMENT_S:g} s of one of {maps}, so that no distance '
            f'is known; it covers {other.times[0]:g} to {other.times[-1]:g} s, {maps} '
            f'{found.times[0]:g} to {found.times[-1]:g} s; compare their clocks'
        )
    if found.origin.calibrated is False:
        say(_uncalibrated(rows))
    hidden = _hidden(rows)
    if hidden:
        say(hidden)
    if output is not None:
        write_rows(output, rows)
        say(f'table: {output}')
    if as_json:
        print_json(
            {
                'maps': maps,
                'grid': str(found.grid),
                'level': level,
                'calibrated': found.origin.calibrated,
                'rows': rows,
            }
        )
        return
    shown = [[_short(row[name]) for name in SHOWN] for row in rows]
    title = f'{maps}, outline at {level:g}'
    if (output or sys.stdout.isatty()) and len(shown) > MOST_ROWS:
        title += f'; {MOST_ROWS} of {len(shown)} maps, --output or --json gives all'
        half = MOST_ROWS // 2
        shown = [*shown[:half], ['...'] * len(SHOWN), *shown[-half:]]
    print_table(title, SHOWN, shown)


def _hidden(rows: list[dict[str, Any]]) -> str:
    """Return which maps hide a part of the rig; '' if all show nearly all of it."""
    from porotwin_checks.checks.tracer_amount import LEAST_SEEN

    seen = {row['time_s']: row['seen'] for row in rows if row['seen'] < LEAST_SEEN}
    if not seen:
        return ''
    time, share = min(seen.items(), key=lambda item: item[1])
    return (
        f'{len(seen)} of {len(rows)} maps hide more than {percent(1.0 - LEAST_SEEN)} of the rig '
        f'(the one at {time:g} s {percent(1.0 - share)}): hidden tracer is neither counted nor in '
        'the deviations'
    )


def _maps(path: Path, rig: Path | None) -> tuple['Rig', 'ConcentrationMaps']:
    """Return the rig and the maps of a file of maps or of a recording."""
    from porotwin_core.rig import load_rig
    from porotwin_recording.experiment.experiment_folder import rig_in
    from porotwin_recording.experiment.recording import open_recording, tell_other_rig
    from porotwin_recording.tables.concentration import open_maps

    if path.suffix != '.nc':
        recording = open_recording(path, rig=rig)
        return recording.rig, recording.present_maps
    chosen = rig or _rig_beside(path)
    if chosen is None:
        raise InputError(f'{path}: no rig.yaml beside it; give one with --rig')
    description = load_rig(chosen)
    tell_other_rig(path, description, rig_in(path.parent))
    return description, open_maps(path, description)


def _rig_beside(path: Path) -> Path | None:
    """Return the rig.yaml beside the file or in the folder `path`, None if there is none."""
    beside = (path if path.is_dir() else path.parent) / 'rig.yaml'
    return beside if beside.is_file() else None


def _rows(
    rig: 'Rig',
    maps: 'ConcentrationMaps',
    other: 'ConcentrationMaps | None',
    level: float,
    side: Any,
) -> list[dict[str, Any]]:
    """Return one row of measures for each map."""
    import numpy as np

    from porotwin_imaging.measures.plume_measures import plume_alone, plume_measures
    from porotwin_imaging.measures.wasserstein import map_distance

    sand = rig.wet_sand(maps.grid)
    pores = np.where(sand, _pores(rig, maps.grid), 0.0)
    rows: list[dict[str, Any]] = []
    before = None
    doubted = []
    for time, (read, deviation, systematic) in zip(maps.times, maps.with_deviations(), strict=True):
        values = np.where(sand & np.isfinite(read), read, np.nan)
        measures = plume_measures(
            values, maps.grid, pores,
            level=level, side=side, deviation=deviation, systematic=systematic,
        )  # fmt: skip
        if _is_far_above_stock(read, level, maps.grid):
            doubted.append(float(time))
        row = {'time_s': float(time), **dataclasses.asdict(measures)}
        alone = plume_alone(values, maps.grid, deviation)
        reference = before if other is None else _at(other, float(time))
        if reference is None or not (measures.seen and np.isfinite(reference).any()):
            row |= {'distance_m': float('nan'), 'mass_change': float('nan')}
        else:
            distance = map_distance(reference, alone, maps.grid, pores)
            row |= {'distance_m': distance.distance_m, 'mass_change': distance.mass_change}
        rows.append(row)
        before = alone if measures.seen else before
    _tell_odd(rows, doubted)
    return rows


def _pores(rig: 'Rig', grid: 'Grid') -> 'FloatArray':
    """Return the volume of the pores of each cell [m^3], (nz, nx), with the effects of the rig."""
    from porotwin_solver.effects import described_physics

    if not rig.effects:
        return rig.cell_pore_volume(grid)
    physics = described_physics(rig, grid)
    return physics.volume * physics.porosity


def _uncalibrated(rows: list[dict[str, Any]]) -> str:
    """Return the warning about amounts of tracer in uncalibrated maps, with their deviation."""
    ratios = [
        row['tracer_deviation_ml'] / row['tracer_ml'] for row in rows if row['tracer_ml'] > 0.0
    ]
    known = [ratio for ratio in ratios if ratio == ratio]
    about = f', known to about {percent(statistics.median(known))}' if known else ''
    return (
        f'uncalibrated maps: tracer_ml is on a default scale{about}; '
        './porotwin calibrate measures the scale from a known injection'
    )


def _is_far_above_stock(values: Any, level: float, grid: 'Grid') -> bool:
    """Return whether the plume of a map has values far above tracer stock, as in percent.

    Its median tells it for a small plume. In noisy maps clean sand lies above the `level` too, and
    then the area of such values tells it.
    """
    import numpy as np

    from porotwin_imaging.measures.plume_measures import PALE_M2

    plume = values[values >= level]
    area_m2 = grid.cell_area * np.count_nonzero(values > MOST_STOCK)
    median = float(np.median(plume)) if plume.size else 0.0
    return median > MOST_STOCK or bool(area_m2 > PALE_M2)


def _tell_odd(rows: list[dict[str, Any]], doubted: list[float]) -> None:
    """Say how many maps hold no value, and how many a plume far above tracer stock."""
    empty = [row['time_s'] for row in rows if not row['seen']]
    if empty:
        say(
            f'{len(empty)} of {len(rows)} maps hold no value, the first at {empty[0]:g} s: '
            'no measures of them'
        )
    if doubted:
        say(
            f'{len(doubted)} of {len(rows)} maps have a plume above {MOST_STOCK:g}, the first at '
            f'{doubted[0]:g} s; 1 is tracer stock: scale the maps'
        )


def _at(maps: 'ConcentrationMaps', time: float) -> Any:
    """Return the plume of the map at `time` [s], None if there is no map within a second."""
    from porotwin_imaging.measures.plume_measures import plume_alone

    index = int(abs(maps.times - time).argmin())
    if abs(maps.times[index] - time) > SAME_MOMENT_S:
        return None
    deviation = None if maps.deviation is None else maps.deviation[index]
    return plume_alone(maps[index], maps.grid, deviation)


def _short(value: float) -> str:
    """Return a number for the table on the screen."""
    return '-' if value != value else f'{value:.4g}'
