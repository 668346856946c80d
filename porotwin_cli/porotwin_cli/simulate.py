"""./porotwin simulate: the physics-based model from rig.yaml and rates.csv, free-running."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from porotwin_cli.output import Json, print_json, progress
from porotwin_core.discovery import module_names
from porotwin_core.errors import InputError
from porotwin_core.grid import Grid


def command(
    experiment: Annotated[Path, typer.Argument(help='Experiment folder or MCAP bag.')],
    output: Annotated[Path, typer.Option(help='NetCDF file to write.')],
    grid: Annotated[str, typer.Option(help="Columns x rows; default: the recording's.")] = '',
    effect: Annotated[
        list[str] | None,
        typer.Option(
            help='NAME:PARAM=VALUE,...; may be given several times. '
            f'Names: {", ".join(module_names("porotwin_solver.effects"))}. '
            'docs/effects.md lists the parameters with their units.'
        ),
    ] = None,
    times: Annotated[
        str, typer.Option(help="START:END:STEP in s; default: the recording's times.")
    ] = '',
    preset: Annotated[str, typer.Option(help='accurate, fast or upwind.')] = 'accurate',
    as_json: Json = False,
) -> None:
    """Simulate an experiment with nothing but its rates.

    Example: ./porotwin simulate experiment --output model.nc --effect decay:rate=1e-4
    """
    from porotwin_recording.concentration import ConcentrationWriter
    from porotwin_recording.recording import open_recording
    from porotwin_solver.effects import parse_effect
    from porotwin_solver.simulation import simulated_maps

    recording = open_recording(experiment)
    rig = recording.rig
    moments = _parse_times(times) if times else recording.times
    if grid:
        on = Grid.parse(grid, rig.width_m, rig.height_m)
    else:
        on = recording.grid if recording.maps is not None else rig.default_grid()
    effects = [parse_effect(text) for text in effect or []]
    maps = simulated_maps(rig, recording.schedule, moments, grid=on, preset=preset, effects=effects)
    with ConcentrationWriter(output, on) as writer, progress() as bar:
        task = bar.add_task('simulating', total=len(moments))
        for time, values in zip(moments, maps, strict=True):
            writer.append(time, values)
            bar.advance(task)
    if as_json:
        print_json({'output': output, 'grid': str(on), 'frames': len(moments), 'preset': preset})
    else:
        print(f'{len(moments)} maps on {on} in {output}')


def _parse_times(text: str) -> np.ndarray:
    try:
        start, end, step = (float(part) for part in text.split(':'))
        return np.arange(start, end + 0.5 * step, step)
    except (ValueError, ZeroDivisionError):
        remedy = 'write START:END:STEP in seconds, like 0:4800:30'
        raise InputError(f"times '{text}': {remedy}") from None
