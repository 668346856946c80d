"""./porotwin rehearse: an experiment on the virtual rig, before it is made on the real one."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from porotwin_cli.options.experiment_times import MOST_GIVEN_TIMES, recorded_times
from porotwin_cli.terminal import Json, as_argument, print_json, progress, refuse_existing, say
from porotwin_core.basis.discovery import extension_names
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, MINUTE_S, ML
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S

if TYPE_CHECKING:
    from porotwin_core.rig import EffectDescription
    from porotwin_recording.experiment.recording import Recording

DURATION_OPTION = '--duration-min, such as 60'

NARROWEST_PX, WIDEST_PX = 300, 8000
"""Widths of photographs [px]: narrower ones show no grains, 8000 x 5000 px are 40 megapixels."""


def command(
    experiment: Annotated[
        Path, typer.Argument(help='Folder with rig.yaml and rates.csv, or an MCAP bag.')
    ],
    output: Annotated[Path, typer.Option(help='Experiment folder to write.')],
    effect: Annotated[
        list[str] | None,
        typer.Option(
            help='An effect that the rig has and its description lacks: NAME:PARAMETER=VALUE,... '
            'May be given several times. '
            f'Names: {", ".join(extension_names("porotwin_rig.effects"))}. '
            'docs/effects.md lists the parameters with their units. '
            'Viscosity and buoyancy, also in rig.yaml, take several times longer than the others, '
            'whatever the --grid; a shorter --duration-min helps.'
        ),
    ] = None,
    duration_min: Annotated[
        float | None,
        typer.Option(
            help='Length of the experiment [min]. Default: until the last row of rates.csv.',
            min=0.1,
            max=LONGEST_EXPERIMENT_S / MINUTE_S,
        ),
    ] = None,
    photo_interval_s: Annotated[
        float, typer.Option(help='Time between two maps [s].', min=1.0, max=86400.0)
    ] = USUAL_PHOTO_INTERVAL_S,
    grid: Annotated[
        str, typer.Option(help='Columns x rows of the maps; default: cells of 5 mm.')
    ] = '',
    photo_width_px: Annotated[
        int | None,
        typer.Option(
            help='Take photographs of this width instead of maps, such as 1600.',
            min=NARROWEST_PX,
            max=WIDEST_PX,
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(help='NetCDF file for the same maps without noise, outside the folder.'),
    ] = None,
    seed: Annotated[int, typer.Option(help='Seed of noise and camera.', min=0)] = 1,
    as_json: Json = False,
) -> None:
    """Make an experiment on a virtual rig, to plan one on the real rig.

    The virtual rig is a simulator of its own, independent of the twin's model. It follows the rates
    and has the effects of rig.yaml and those given here. The folder looks like a recording of the
    real rig: rig.yaml, rates.csv, and maps with the noise and blur of an ordinary camera. It does
    not name the effects given here. `./porotwin diagnose` tells whether it finds them, and so
    whether these rates would show them.

    With --photo-width-px the folder holds photographs instead of maps. Two rehearsals with the same
    seed have the same camera, so that a known injection calibrates it for the other one. --truth
    keeps the maps without noise, for `evaluate --reference`.

    Example: ./porotwin rehearse planned --output rehearsed --effect leak:x=0.6,z=0.3,rate=-50

    Example: ./porotwin rehearse planned --output photographed --photo-width-px 1600
    """
    from porotwin_checks.checks import unbalanced_rates
    from porotwin_cli.options.grids import grid_of
    from porotwin_cli.options.output_files import check_output
    from porotwin_core.basis.whole_folder import whole_folder
    from porotwin_recording.experiment.experiment_folder import MAPS_FILE
    from porotwin_recording.experiment.recording import odd_lines, open_recording
    from porotwin_recording.tables.one_writer import one_writer
    from porotwin_rig.effects import parse_effects, refuse_slips
    from porotwin_rig.made_experiment import make_experiment
    from porotwin_rig.map_camera import MapNoise
    from porotwin_rig.virtual_rig import VirtualRig

    refuse_existing(output)
    if truth is not None:
        check_output(truth, experiment)
    effects = parse_effects(';'.join(effect or []))
    _refuse_rig_alone(experiment)
    recording = open_recording(experiment)
    for line in odd_lines([recording], {'unbalanced_rates': unbalanced_rates.CHECK}):
        say(line)  # pumps stall in a closed rig, which no model predicts
    refuse_slips(effects, recording.rig)
    duration = _duration(recording, duration_min)
    if photo_interval_s > duration:
        raise InputError(
            f'--photo-interval-s {photo_interval_s:g}: is longer than the experiment of '
            f'{duration:g} s; take a shorter one'
        )
    if duration / photo_interval_s > MOST_GIVEN_TIMES:
        raise InputError(
            f'{duration / photo_interval_s:.0f} maps are more than {MOST_GIVEN_TIMES}; give a '
            'larger --photo-interval-s'
        )
    photographs = photo_width_px is not None
    if grid and photographs:
        raise InputError('--grid: photographs have no cells yet; give it to ./porotwin image')
    map_grid = grid_of(grid, recording.rig)
    with one_writer(output), whole_folder(output) as unfinished, progress() as bar:
        task = bar.add_task('running the virtual rig', total=1.0)
        made = make_experiment(
            unfinished,
            VirtualRig(recording.rig, effects=(*recording.rig.effects, *effects)),
            commanded=recording.delivered,
            duration=duration,
            photo_interval=photo_interval_s,
            seed=seed,
            noise=MapNoise(),
            grid=map_grid,
            photo_width_px=photo_width_px,
            truth=truth,
            progress=lambda share: bar.update(task, completed=share),
        )
        if photographs:  # imaging makes the maps
            (unfinished / MAPS_FILE).unlink()
    kind = 'photographs' if photographs else 'maps'
    if as_json:
        print_json(
            {
                'output': output,
                kind: len(made.times),
                'noise_floor': None if photographs else made.noise_floor,
                'injected_m3': made.injected,
                'removed_m3': made.removed,
                'hidden': effect or [],
            }
        )
        return
    ways = ' or '.join(_ways_out(recording, effects))
    print(
        f'{output}: {len(made.times)} {kind} over {duration / 60.0:.0f} min; '
        f'{made.injected * ML:z.1f} ml of stock injected, {made.removed * ML:z.1f} ml of it removed'
        + (f' by {ways}' if made.removed > 0.0 and ways else '')
    )
    if effect:
        print(f'hidden: {"; ".join(effect)}')
    print(_next_step(output, len(made.times), photographs=photographs))


def _next_step(output: Path, maps: int, *, photographs: bool) -> str:
    from porotwin_diagnosis.data.sample import FEWEST_FRAMES

    if photographs:
        folder = as_argument(output)
        return (
            f'next: ./porotwin calibrate {folder}, if it is a known injection; else ./porotwin '
            f'image {folder} --output {folder}/concentration.nc --calibration CALIBRATION'
        )
    if maps < FEWEST_FRAMES:
        return f'{maps} maps are too few for a diagnosis, which needs {FEWEST_FRAMES}'
    return f'next: ./porotwin diagnose {as_argument(output)} --output REPORT'


def _refuse_rig_alone(experiment: Path) -> None:
    """Check that `experiment` is no folder with a rig alone.

    Raises:
        InputError: it is one; the line asks for rates.
    """
    from porotwin_recording.experiment.experiment_folder import COMMANDED_FILE, FILES, RIG_FILE

    folder = experiment.parent if experiment.name == RIG_FILE else experiment
    if [name for name in FILES if (folder / name).is_file()] == [RIG_FILE]:
        raise InputError(
            f'{folder}: has no {COMMANDED_FILE} to rehearse; write one beside {RIG_FILE} '
            '(docs/formats.md shows one)'
        )


def _ways_out(recording: 'Recording', effects: 'Sequence[EffectDescription]') -> list[str]:
    """Return what may remove tracer: wells that take water out, leaks, open sides."""
    wells = {row.well for row in recording.delivered.rows if row.rate.rate < 0.0}
    leaks = ['a leak' for effect in (*recording.rig.effects, *effects) if effect.water_ml_h < 0.0]
    return [*sorted(wells), *leaks[:1], *(['open sides'] if not recording.rig.closed else [])]


def _duration(recording: 'Recording', minutes: float | None) -> float:
    """Return the length of the experiment [s], by the option or by the recording."""
    if minutes is not None:
        return 60.0 * minutes
    last = recorded_times(recording, option=DURATION_OPTION)[-1]
    if not (math.isfinite(last) and last > 0.0):
        raise InputError(f'{recording.source}: ends at its start; give {DURATION_OPTION}')
    return last
