"""./porotwin segment: photographs of CO2 with a pH indicator to maps of phases."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from porotwin_cli.options.crew_options import Scheduler, Workers
from porotwin_cli.options.output_files import maker, one_call_for_each_output, write_rows
from porotwin_cli.terminal import Json, WorkFailed, print_json, print_table, progress, say
from porotwin_core.basis.errors import InputError
from porotwin_core.clock.stamps import SAME_MOMENT_S

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from porotwin_core.basis.parallel import Crew
    from porotwin_core.geometry.grid import Grid
    from porotwin_core.rig import Rig
    from porotwin_imaging.phases.colour_change import Box
    from porotwin_imaging.phases.phase_segmentation import PhaseMap
    from porotwin_imaging.phases.phase_series import SeriesMatch
    from porotwin_imaging.phases.phase_study import PhaseStudy
    from porotwin_recording.tables.photos import Photo

SHOWN = ('time_s', 'phase', 'area_m2', 'doubt_m2', 'pores_ml', 'contour_m', 'x_m', 'z_m', 'parts')
"""Columns of the table."""


TRACER = (
    'is this tracer? everything that changed is darker in all colours: a dye does that, but an '
    'indicator changes its hue, and gas leaves bright sand. Of tracer, the areas mean nothing: '
    './porotwin image makes its maps'
)
"""Warning about photographs of dye."""

_BOX_HELP = 'Box that shows {}: left,bottom,right,top [m], and @time [s] of a photograph.'


@one_call_for_each_output
def command(
    experiment: Annotated[Path, typer.Argument(help='Experiment folder or bag with photographs.')],
    output: Annotated[Path, typer.Option(help='NetCDF file to write.')],
    grid: Annotated[str, typer.Option(help='Columns x rows; default: cells of 5 mm.')] = '',
    dissolved: Annotated[
        list[str] | None, typer.Option(help=_BOX_HELP.format('dissolved CO2'))
    ] = None,
    gas: Annotated[list[str] | None, typer.Option(help=_BOX_HELP.format('gas'))] = None,
    water: Annotated[
        list[str] | None, typer.Option(help='Box that always shows water without CO2.')
    ] = None,
    series: Annotated[
        Path | None,
        typer.Option(
            help='Folder of maps (csv, names end in the time): tells the time of each photograph.'
        ),
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = '',
    as_json: Json = False,
) -> None:
    """Segment photographs of CO2 with a pH indicator into water, dissolved CO2 and gas.

    The baseline must show the rig before the injection, with the indicator in its water. Without
    boxes, the command finds the colours of the phases in the photographs. With boxes, it looks for
    the phases of the boxes only. A table of areas (.csv) and a picture (.png) lie beside the
    output.

    Example: ./porotwin segment experiment --output phases.nc --gas 0.9,0.6,1.1,0.7@3600
    --dissolved 0.9,0.4,1.1,0.5@3600
    """
    from porotwin_cli.options.grids import grid_of
    from porotwin_cli.options.output_files import check_output
    from porotwin_cli.photographs.many_photos import read_photo
    from porotwin_cli.pictures.phase_picture import phase_sheet
    from porotwin_cli.pictures.rig_drawing import picture_beside
    from porotwin_core.basis.parallel import crew
    from porotwin_imaging.baseline.baseline import make_baseline
    from porotwin_imaging.geometry.imaging_cost import map_cost
    from porotwin_imaging.phases.phase_colours import DISSOLVED, GAS, PHASES, WATER
    from porotwin_imaging.phases.phase_study import PhaseStudy
    from porotwin_imaging.photograph.photo_file import MOST_PIXELS, photo_size
    from porotwin_recording.experiment.recording import open_recording
    from porotwin_recording.tables.phase_csv import read_phase_series

    picture, table = picture_beside(output), output.with_suffix('.csv')
    for path in (output, picture, table):
        check_output(path, experiment, command='segment', named=path == output)
    boxes = {
        WATER: _boxes(water, '--water'),
        DISSOLVED: _boxes(dissolved, '--dissolved'),
        GAS: _boxes(gas, '--gas'),
    }
    maps = read_phase_series(series, len(PHASES)) if series else {}
    recording = open_recording(experiment)
    rig = recording.rig
    map_grid = grid_of(grid, rig, MOST_PIXELS)
    states = [photo for photo in recording.photos if photo.role == 'state']
    baselines = [photo for photo in recording.photos if photo.role == 'baseline']
    first = [read_photo(photo) for photo in baselines]
    if not first or not states:
        raise InputError(
            f'{experiment}: needs a baseline, with the indicator but without CO2, and at least one '
            'state photograph; give their roles in imaging.csv'
        )
    names = [str(experiment / photo.name) for photo in baselines]
    baseline = make_baseline(rig, map_grid, first, names=names)
    for remark in baseline.remarks:
        say(remark)
    study = PhaseStudy.of({photo.time: photo.read for photo in states}, baseline, boxes)
    _tell_colours(study, given=bool(dissolved or gas))
    _tell_times(boxes, [photo.time for photo in states])
    memory = map_cost(rig, map_grid, photo_size(first[0])).memory_bytes
    pool = crew(workers=workers, scheduler=scheduler, threads=True, task_bytes=memory, tell=say)
    with pool:
        work = _segment(states, study, output, rig, maps, pool)
    rows, refused = work.rows, work.refused
    phase_sheet(picture, rig, work.shown, output.name)
    write_rows(table, rows)
    if as_json:
        print_json(
            {
                'output': output,
                'picture': picture,
                'table': table,
                'grid': str(map_grid),
                'colours': study.colours.words(),
                'perhaps_tracer': study.colours.darken_only(),
                'phases': rows,
                'dates': {time: match._asdict() for time, match in work.dates.items()},
                'remarks': work.remarks,
                'refused': refused,
            }
        )
        return
    print(f'{len(work.remarks)} maps on {map_grid} in {output}, {len(refused)} photographs refused')
    last = [row for row in rows if row['time_s'] == rows[-1]['time_s']]
    print_table(
        'the last photograph', SHOWN, [[_short(row[name]) for name in SHOWN] for row in last]
    )
    print(f'all photographs: {table}; picture: {picture}')


def _boxes(texts: Sequence[str] | None, name: str) -> 'list[Box]':
    """Return the boxes of an option."""
    from porotwin_imaging.phases.colour_change import box_of

    return [box_of(text, name) for text in texts or ()]


def _tell_colours(study: 'PhaseStudy', *, given: bool) -> None:
    """Say which colours the phases have, and which phase has none."""
    for line in study.colours.words():
        say(line)
    for name in () if given else study.missing():
        say(f'{name}: no such colour in these photographs; if there is some, show it with --{name}')
    if study.colours.darken_only():
        say(TRACER)


def _tell_times(boxes: 'dict[int, list[Box]]', times: 'list[float]') -> None:
    """Say which photograph shows a box if there is none at its time."""
    from porotwin_imaging.phases.phase_colours import PHASES

    for phase, given in boxes.items():
        for box in given:
            if box.time is None:
                continue
            time = box.time
            nearest = min(times, key=lambda each: abs(each - time))
            if abs(nearest - time) > SAME_MOMENT_S:
                say(
                    f'{PHASES[phase]} {box}: there is no photograph at {time:g} s; that at '
                    f'{nearest:g} s is taken'
                )


@dataclasses.dataclass
class _Work:
    """The results of a run: rows, and by time some maps, remarks and dates; the refused."""

    rows: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    shown: 'dict[float, PhaseMap]' = dataclasses.field(default_factory=dict)
    remarks: dict[str, list[str]] = dataclasses.field(default_factory=dict)
    dates: dict[str, 'SeriesMatch'] = dataclasses.field(default_factory=dict)
    refused: list[str] = dataclasses.field(default_factory=list)


def _phases(content: bytes, study: 'PhaseStudy') -> 'PhaseMap':
    """Return the phases in a photograph."""
    return study.phases(content)


def _segment(
    states: 'Sequence[Photo]',
    study: 'PhaseStudy',
    output: Path,
    rig: 'Rig',
    maps: 'Mapping[float, NDArray[np.uint8]]',
    pool: 'Crew',
) -> _Work:
    """Write the maps of all photographs; return their measures."""
    from porotwin_cli.photographs.many_photos import each_photo
    from porotwin_cli.pictures.rig_drawing import chosen_maps
    from porotwin_imaging.phases.colour_change import REASONS
    from porotwin_imaging.phases.phase_colours import PHASES
    from porotwin_imaging.phases.phase_series import series_match
    from porotwin_recording.tables.phase_maps import PhaseMapWriter

    grid, work, words = study.baseline.grid, _Work(), study.colours.words()
    drawn = chosen_maps(len(states))
    program = maker('segment')
    with PhaseMapWriter(output, grid, PHASES, REASONS, program=program, colours=words) as writer:
        with progress() as bar:
            task = bar.add_task('photographs', total=len(states))
            for number, (photo, found) in enumerate(each_photo(pool, _phases, states, study)):
                if isinstance(found, InputError):
                    work.refused.append(f'{photo.name}: {found}')
                    say(work.refused[-1])
                else:
                    writer.append(photo.time, found.phase, found.confidence, found.reason)
                    work.rows += _rows(found, photo.time, rig, grid)
                    work.remarks[f'{photo.time:g}'] = found.remarks
                    if maps:
                        match = work.dates[f'{photo.time:g}'] = series_match(found.phase, maps)
                        say(
                            f'{photo.name}: {match.time_s:.0f} s in the series; the map at '
                            f'{match.map_time_s:g} s overlaps by {match.overlap:.2f}'
                        )
                    if number in drawn:
                        work.shown[photo.time] = found
                bar.advance(task)
        if not work.rows:
            raise WorkFailed('no photograph could be used')
    return work


def _rows(found: 'PhaseMap', time: float, rig: 'Rig', grid: 'Grid') -> list[dict[str, Any]]:
    """Return a row of measures for each phase in a photograph taken at `time` [s]."""
    from porotwin_imaging.phases.phase_colours import PHASES
    from porotwin_imaging.phases.phase_measures import phase_measures

    pores = rig.cell_pore_volume(grid)
    return [
        {
            'time_s': time,
            'phase': name,
            **dataclasses.asdict(phase_measures(found, number, grid, pores)),
        }
        for number, name in enumerate(PHASES)
    ]


def _short(value: Any) -> str:
    """Return a value for the table on the screen."""
    if isinstance(value, str):
        return value
    return '-' if value != value else f'{value:.4g}'
