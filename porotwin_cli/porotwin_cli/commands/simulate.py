"""./porotwin simulate: the physics-based model alone, from the rig and its rates."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from porotwin_cli.options.experiment_times import (
    MOST_GIVEN_TIMES,
    MOST_TIMES,
    recorded_times,
    times_in,
)
from porotwin_cli.options.output_files import one_call_for_each_output
from porotwin_cli.terminal import Json, as_argument, print_json, progress, say
from porotwin_core.basis.discovery import extension_names
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import DAY_S, LONGEST_EXPERIMENT_S
from porotwin_core.model.preset_names import FREE_PRESET_WORDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from porotwin_cli.recorded.free_run_errors import LateMaps
    from porotwin_core.geometry.grid import FloatArray, Grid
    from porotwin_core.rig import EffectDescription
    from porotwin_recording.experiment.recording import Recording

MOST_CELLS = 10_000_000
"""Most cells of a simulation; it takes 0.4 kB for each, so 4 GB."""

TIMES_OPTION = '--times START:END:STEP [s], such as 0:1800:60'

LARGEST_BLUR = 20.0
"""Largest blur [cells]; no camera blurs so much."""


@one_call_for_each_output
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
            f'Names: {", ".join(extension_names("porotwin_solver.effects"))}. '
            'docs/effects.md lists the parameters with their units.'
        ),
    ] = None,
    times: Annotated[
        str,
        typer.Option(
            help='START:END:STEP [s]. Default: the times of the maps or photographs, or a map at '
            'least every half minute until the last row of rates.csv, but at most some '
            f'{MOST_TIMES} maps.'
        ),
    ] = '',
    preset: Annotated[
        str, typer.Option(help=f'Preset: {FREE_PRESET_WORDS}; see docs/solver.md.')
    ] = 'accurate',
    device: Annotated[
        str,
        typer.Option(
            help="Where the tracer moves: 'cpu', or 'cuda' for a graphics processor, which pays "
            'on grids of a million cells. The flow is always solved on the processor.'
        ),
    ] = 'cpu',
    blur: Annotated[
        float,
        typer.Option(
            help='Blur of the written maps, like from a camera: width of a Gaussian [cells].',
            min=0.0,
            max=LARGEST_BLUR,
        ),
    ] = 0.0,
    as_json: Json = False,
) -> None:
    """Simulate an experiment from its rates.

    The simulation reads the rig and the rates of the recording, but no maps. Measured rates count
    where there are any, commanded ones elsewhere, as in a diagnosis. If the recording has maps, the
    command prints the error over their last 30 % and the best blur. A picture of the maps lies
    beside the output, with the same name and the suffix .png.

    Example: ./porotwin simulate experiment --output model.nc --effect decay:rate=1e-4
    """
    from scipy.ndimage import gaussian_filter

    from porotwin_cli.options.given_effects import given_effects
    from porotwin_cli.options.grids import coupled_flow_seconds, grid_of, tell_cost
    from porotwin_cli.options.output_files import check_output, maker, maps_are_kept
    from porotwin_cli.pictures.rig_drawing import chosen_maps, picture_beside, sheet_of_maps
    from porotwin_cli.recorded.run_course import run_course
    from porotwin_recording.experiment.recording import open_recording
    from porotwin_recording.tables.concentration import ConcentrationWriter, MapOrigin
    from porotwin_solver.effects import described_physics
    from porotwin_solver.model.free_run_step import longest_free_step
    from porotwin_solver.model.prediction_cost import prediction_cost
    from porotwin_solver.model.presets import free_run_preset
    from porotwin_solver.model.simulation import simulated_maps

    free_run_preset(preset)
    picture = picture_beside(output)
    for path in (output, picture):
        check_output(path, experiment, command='simulate', named=path == output)
    recording = open_recording(experiment)
    rig = recording.rig
    schedule = recording.delivered
    moments = _parse_times(times) if times else recorded_times(recording, option=TIMES_OPTION)
    recorded = recording.grid if recording.maps is not None else rig.default_grid()
    cells = grid_of(grid, rig, MOST_CELLS) if grid else recorded
    effects = given_effects(effect or [], rig)
    last = max(moments, default=0.0)
    rates = schedule.busiest
    physics = described_physics(rig, cells, effects)
    step = longest_free_step(physics, rates)
    cost = prediction_cost(rig, cells, preset=preset, duration=last, rates=rates, longest_step=step)
    tell_cost(cost, 'simulation', more=coupled_flow_seconds(physics, cost.steps))
    course = run_course(moments, step)
    maps = simulated_maps(
        rig,
        schedule,
        [moment.time for moment in course],
        grid=cells,
        preset=preset,
        effects=effects,
        device=device,
    )
    origin = MapOrigin(program=maker('simulate'))
    compared = _late_maps(recording, cells, times, preset, effects)
    shown = chosen_maps(len(moments))
    pictured: list[FloatArray] = []
    with ConcentrationWriter(output, cells, origin=origin) as writer, progress() as bar:
        task = bar.add_task('simulating', total=len(course))
        index = 0
        for (time, is_map), values in zip(course, maps, strict=True):
            bar.advance(task)
            if not is_map:
                continue
            written = gaussian_filter(values, blur) if blur else values
            writer.append(time, written)
            if index in shown:
                pictured.append(written)
            if compared is not None:
                compared.see(index, values)
            index += 1
    title = f'{recording.source.name}: model, preset {preset}'
    with maps_are_kept(output):
        sheet_of_maps(
            picture, rig, [moments[index] for index in shown], pictured, title, command='simulate'
        )
    errors = compared.errors() if compared is not None else None
    if as_json:
        print_json(
            {
                'output': output,
                'picture': picture,
                'grid': str(cells),
                'frames': len(moments),
                'preset': preset,
                'errors': None if errors is None else asdict(errors),
            }
        )
        return
    print(f'{len(moments)} maps on {cells} in {output}, picture: {picture}')
    if errors is not None:
        print(errors)
    measured = f'{as_argument(output)}{_rig_option(output, experiment)}'
    say(f'next: ./porotwin measure {measured} --output plume.csv{_diagnosis(recording)}')


def _rig_option(output: Path, experiment: Path) -> str:
    """Return the option that names the rig, if its description is not beside the output."""
    from porotwin_recording.experiment.experiment_folder import RIG_FILE

    described = experiment / RIG_FILE
    if (output.parent / RIG_FILE).is_file() or not described.is_file():
        return ''
    return f' --rig {as_argument(described)}'


def _diagnosis(recording: 'Recording') -> str:
    """Return the further advice for a recording with maps."""
    if recording.maps is None:
        return ''
    source = as_argument(recording.source)
    return f'; ./porotwin diagnose {source} --output REPORT finds the cause of an error'


def _late_maps(
    recording: 'Recording',
    grid: 'Grid',
    times: str,
    preset: str,
    effects: 'Sequence[EffectDescription]',
) -> 'LateMaps | None':
    """Return the maps to compare with; None: there are none at these times and cells."""
    from porotwin_cli.recorded.free_run_errors import LateMaps

    if recording.maps is None or times or recording.grid != grid or len(recording.times) < 2:
        return None
    return LateMaps(recording, preset, effects)


def _parse_times(text: str) -> list[float]:
    """Return the times START, START + STEP, ... END [s]."""
    import numpy as np

    start, end, step = times_in(text, 3)
    if not (math.isfinite(start + end + step) and start <= end and step > 0.0):
        raise InputError(f"times '{text}': write START:END:STEP in seconds, like 0:4800:30")
    if start < 0.0:
        raise InputError(f"times '{text}': begin before the experiment; let START be 0 or later")
    if end > LONGEST_EXPERIMENT_S:
        days = LONGEST_EXPERIMENT_S / DAY_S
        raise InputError(f"times '{text}': end after {days:g} days; write seconds, like 0:4800:30")
    if (end - start) / step >= MOST_GIVEN_TIMES:
        raise InputError(f"times '{text}': more than {MOST_GIVEN_TIMES} maps; take a larger STEP")
    times: list[float] = np.arange(start, end + 0.5 * step, step).tolist()
    return times
