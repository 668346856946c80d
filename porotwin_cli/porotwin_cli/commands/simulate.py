"""./porotwin simulate: the physics-based model alone, from rig.yaml and rates.csv."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.terminal import Json, print_json, progress
from porotwin_core.discovery import module_names
from porotwin_core.errors import InputError


def command(
    experiment: Annotated[Path, typer.Argument(help='Experiment folder or MCAP bag.')],
    output: Annotated[Path, typer.Option(help='NetCDF file to write.')],
    grid: Annotated[
        str, typer.Option(help='Columns x rows, such as 187x112. Default: from the recording.')
    ] = '',
    effect: Annotated[
        list[str] | None,
        typer.Option(
            help='NAME:PARAMETER=VALUE,... May be given several times. '
            f'Names: {", ".join(module_names("porotwin_solver.effects"))}. '
            'docs/effects.md lists the parameters with their units.'
        ),
    ] = None,
    times: Annotated[
        str, typer.Option(help='START:END:STEP [s]. Default: the times of the recording.')
    ] = '',
    preset: Annotated[str, typer.Option(help='Preset: accurate, fast or upwind.')] = 'accurate',
    as_json: Json = False,
) -> None:
    """Simulate an experiment from its rates.

    The simulation runs freely: it reads the rig and the rates of the recording, but no maps.

    Example: ./porotwin simulate experiment --output model.nc --effect decay:rate=1e-4
    """
    from porotwin_cli.grids import grid_of, tell_cost
    from porotwin_recording.concentration import ConcentrationWriter
    from porotwin_recording.recording import open_recording
    from porotwin_solver.effects import parse_effect
    from porotwin_solver.prediction_cost import prediction_cost
    from porotwin_solver.simulation import simulated_maps

    recording = open_recording(experiment)
    rig = recording.rig
    if not times and recording.maps is None:
        raise InputError(
            f'{experiment}: has no maps whose times could be simulated; '
            'give --times START:END:STEP [s], such as --times 0:1800:60'
        )
    moments = _parse_times(times) if times else recording.times
    recorded = recording.grid if recording.maps is not None else rig.default_grid()
    cells = grid_of(grid, rig) if grid else recorded
    effects = [parse_effect(text) for text in effect or []]
    last = max(moments, default=0.0)
    tell_cost(prediction_cost(rig, cells, preset=preset, duration=last), 'simulation')
    maps = simulated_maps(
        rig, recording.schedule, moments, grid=cells, preset=preset, effects=effects
    )
    with ConcentrationWriter(output, cells) as writer, progress() as bar:
        task = bar.add_task('simulating', total=len(moments))
        for time, values in zip(moments, maps, strict=True):
            writer.append(time, values)
            bar.advance(task)
    if as_json:
        print_json({'output': output, 'grid': str(cells), 'frames': len(moments), 'preset': preset})
    else:
        print(f'{len(moments)} maps on {cells} in {output}')


def _parse_times(text: str) -> list[float]:
    """Return the times START, START + STEP, ... END [s]."""
    import numpy as np

    try:
        start, end, step = (float(part) for part in text.split(':'))
        times: list[float] = np.arange(start, end + 0.5 * step, step).tolist()
    except (ValueError, ZeroDivisionError):
        times = []
    if not times or times[-1] < times[0]:
        raise InputError(f"times '{text}': write START:END:STEP in seconds, like 0:4800:30")
    return times
