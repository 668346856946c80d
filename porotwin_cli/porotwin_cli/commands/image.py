"""./porotwin image: photographs to concentration maps."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from porotwin_cli.crew_options import Scheduler, Workers
from porotwin_cli.output_files import one_call_for_each_output
from porotwin_cli.terminal import Json, WorkFailed, print_json, progress, refuse_existing, say
from porotwin_core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from porotwin_cli.map_sureness import Doubt
    from porotwin_core.grid import Grid
    from porotwin_core.rig import Rig
    from porotwin_core.wells import Schedule
    from porotwin_imaging.calibration import Calibration
    from porotwin_recording.photos import Photo

UNCALIBRATED = (
    'uncalibrated: the plume is where it is shown, but the concentrations are on a default scale; '
    './porotwin calibrate measures the scale from a known injection'
)

LONG_S = 5.0
"""Processor time for one photograph above which the command tells the cost before it begins [s]."""


@one_call_for_each_output
def command(
    experiment: Annotated[Path, typer.Argument(help='Experiment folder or bag with photographs.')],
    output: Annotated[
        Path,
        typer.Option(help='NetCDF file to write; the experiment reads its concentration.nc.'),
    ],
    grid: Annotated[str, typer.Option(help='Columns x rows; default: cells of 5 mm.')] = '',
    calibration: Annotated[Path | None, typer.Option(help='Calibration of the camera.')] = None,
    learnt: Annotated[
        Path | None,
        typer.Option(help='Folder to make: the calibration with the factors learnt here, for up.'),
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = '',
    as_json: Json = False,
) -> None:
    """Turn the photographs of an experiment into maps of tracer concentration.

    The other commands, such as diagnose, read the maps of an experiment folder from the file
    concentration.nc in it. A picture of the maps lies beside the output, with the same name and the
    suffix .png. A bad photograph is named and left out. If the calibration only guessed the factor
    of a sand, the core of the plume in that sand corrects it. --learnt FOLDER keeps the corrected
    calibration for ./porotwin up --calibration FOLDER/calibration.yaml. After an interruption a
    second call continues. It begins anew if the photographs, rig.yaml, the rates or the calibration
    with its pictures have changed since.

    Example: ./porotwin image experiment --output experiment/concentration.nc --grid 280x150
    """
    from porotwin_cli.grids import grid_of
    from porotwin_cli.many_photos import each_photo
    from porotwin_cli.map_sureness import (
        doubt_entry,
        guessed_sands,
        plume_doubt,
        sureness_words,
        typical_doubt,
    )
    from porotwin_cli.output_files import check_output, maker
    from porotwin_cli.photo_remarks import PhotoRemarks
    from porotwin_cli.rig_drawing import picture_beside
    from porotwin_cli.same_photos import PhotoDigests, told
    from porotwin_core.parallel import crew
    from porotwin_imaging.baseline import make_baseline
    from porotwin_imaging.calibration import load_calibration, save_calibration
    from porotwin_imaging.covered_baseline import uncovered
    from porotwin_imaging.file_hash import sha256_of_file
    from porotwin_imaging.photo_file import MOST_PIXELS
    from porotwin_imaging.photo_names import named
    from porotwin_imaging.photo_to_map import concentration_map
    from porotwin_imaging.sand_refinement import refined
    from porotwin_recording.concentration import MapOrigin
    from porotwin_recording.map_parts import MapParts
    from porotwin_recording.photo_source import fingerprints
    from porotwin_recording.recording import open_recording

    picture = picture_beside(output)
    for path in (output, picture):
        check_output(path, experiment, calibration, command='image')
    _check_learnt(learnt, calibration)
    recording = open_recording(experiment)
    rig = recording.rig
    map_grid = grid_of(grid, rig, MOST_PIXELS)
    baselines = [photo for photo in recording.photos if photo.role == 'baseline']
    states = [photo for photo in recording.photos if photo.role == 'state']
    if not baselines or not states:
        raise InputError(
            f'{experiment}: needs a baseline and at least one state photograph; '
            'give their times and roles in imaging.csv (docs/formats.md)'
        )
    rates = recording.known_rates
    names = [str(experiment / photo.name) for photo in baselines]
    with named(names[0]):
        memory = _tell_cost(baselines[0], rig, map_grid)
    used = load_calibration(calibration) if calibration else None
    origin = MapOrigin(calibration is not None, sha256_of_file(calibration), maker('image'))
    source = {**fingerprints(recording), **_pictures(used)}
    clean = [photo.read() for photo in baselines]
    if used:
        better = refined(
            used,
            rig,
            clean,
            [(photo.time, photo.read) for photo in states],
            rates,
            source=experiment.name,
            baseline_names=names,
        )
        used = better.calibration
        for line in better.lines:
            say(line)
        if learnt:
            save_calibration(used, learnt / 'calibration.yaml')
            say(_learnt_words(learnt, len(better.lines)))
    known_factors = used.factor_deviations if used else ()
    baseline = make_baseline(
        rig,
        map_grid,
        clean,
        calibration=used,
        names=names,
    )
    baseline, cover = uncovered(baseline, [photo.read for photo in states], names)
    for remark in (*baseline.remarks, *((str(cover),) if cover else ())):
        say(remark)
    imaged, refused, doubts, remarks = [], [], [], PhotoRemarks(say)
    pool = crew(workers=workers, scheduler=scheduler, threads=True, task_bytes=memory, tell=say)
    writing = MapParts(output, rig, map_grid, source=source, origin=origin)
    digests = PhotoDigests()
    done, left = _done_and_left(states, writing.earlier)
    if writing.changed:
        say(f'beginning anew: {", ".join(writing.changed)} changed since an interrupted call')
    if done:
        say(f'going on behind {len(done)} maps of an interrupted call')
    with pool, writing as writer, progress() as bar:
        task = bar.add_task('photographs', total=len(states), completed=len(states) - len(left))
        for photo, found in each_photo(pool, concentration_map, left, baseline, digests.note):
            try:
                if isinstance(found, InputError):
                    raise found
                writer.append(
                    photo.time,
                    found.values,
                    deviation=found.deviation,
                    systematic=found.systematic,
                )
            except InputError as error:
                refused.append(f'{photo.name}: {error}')
                say(refused[-1])
            else:
                remarks.tell(photo.name, found.status if used else found.status[1:])
                doubts.append(plume_doubt(found.values, found.deviation, found.systematic))
                imaged.append(
                    {
                        'time_s': photo.time,
                        'photo': photo.name,
                        'remarks': found.status,
                        'plume': doubt_entry(doubts[-1]),
                    }
                )
            bar.advance(task)
        if not imaged and not done:
            raise WorkFailed('no photograph could be used')
    if done:
        before = _imaged_before(output, rig, done)
        imaged = [*(entry for entry, _ in before), *imaged]
        doubts = [*(doubt for _, doubt in before), *doubts]
    _draw(picture, output, rig, calibrated=calibration is not None)
    remarks.tell_the_rest()
    same = digests.same_files(states)
    for line in told(same):
        say(line)
    photos = [str(entry['photo']) for entry in imaged]
    masses = _remarks_about_masses(output, rig, rates if used else None, photos)
    for line in filter(None, masses.values()):
        say(line)
    if as_json:
        print_json(
            {
                'output': output,
                'picture': picture,
                'grid': str(map_grid),
                'calibrated': calibration is not None,
                'plume': doubt_entry(typical_doubt(doubts)),
                'guessed_sands': guessed_sands(known_factors) if used else None,
                'maps': imaged,
                'refused': refused,
                'covered_baseline': str(cover) if cover else None,
                'same_files': [run.entry for run in same],
                **masses,
            }
        )
        return
    print(f'{len(imaged)} maps on {map_grid} in {output}, {len(refused)} photographs refused')
    for line in sureness_words(doubts, known_factors):
        print(line)
    print(f'picture: {picture}')
    if calibration is None:
        print(UNCALIBRATED)


def _check_learnt(learnt: Path | None, calibration: Path | None) -> None:
    """Check that the folder `learnt` can be made, and that there is something to learn from.

    Raises:
        InputError: it exists, or there is no calibration.
    """
    if learnt is None:
        return
    if calibration is None:
        raise InputError('--learnt corrects a calibration; name one with --calibration')
    refuse_existing(learnt)


def _learnt_words(folder: Path, corrected: int) -> str:
    """Return how to use the calibration in `folder`, with the number of `corrected` factors."""
    what = f'{corrected} learnt factors' if corrected else 'no other factors than before'
    return f'{folder}: calibration with {what}; use it with --calibration {folder}/calibration.yaml'


def _pictures(calibration: 'Calibration | None') -> dict[str, str]:
    """Return the fingerprint of the pictures of a calibration, by name."""
    if calibration is None:
        return {}
    return {'pictures of the calibration': calibration.picture_fingerprint}


def _done_and_left(
    states: 'list[Photo]', earlier: 'Sequence[float]'
) -> 'tuple[list[Photo], list[Photo]]':
    """Return the photographs of the maps at the `earlier` times [s], and the others.

    Photographs that an interrupted call refused are among the others: they tell their reasons once
    more.
    """
    waiting = set(earlier)
    done: list[Photo] = []
    left: list[Photo] = []
    for photo in states:
        (done if photo.time in waiting else left).append(photo)
        waiting.discard(photo.time)
    return done, left


def _imaged_before(
    output: Path, rig: 'Rig', photos: 'list[Photo]'
) -> 'list[tuple[dict[str, Any], Doubt]]':
    """Return the entries and doubts of the maps that an interrupted call had made."""
    from porotwin_cli.map_sureness import doubt_entry, plume_doubt
    from porotwin_recording.concentration import open_maps

    found = []
    for photo, fields in zip(photos, open_maps(output, rig).with_deviations(), strict=False):
        values, deviation, systematic = fields
        assert deviation is not None and systematic is not None
        doubt = plume_doubt(values, deviation, systematic)
        entry = {
            'time_s': photo.time,
            'photo': photo.name,
            'remarks': 'imaged by an earlier call',
            'plume': doubt_entry(doubt),
        }
        found.append((entry, doubt))
    return found


def _remarks_about_masses(
    output: Path, rig: 'Rig', rates: 'Schedule | None', photos: list[str]
) -> dict[str, str | None]:
    """Return remarks about the tracer in the maps of `output` beside the `rates`, by their keys.

    - `out_of_course`: which of the `photos` are out of the course of the tracer.
    - `too_much_tracer`: a map holds more tracer than was injected before it.
    - `pale_well`: the maps show no tracer at a well that injects it.
    """
    from porotwin_core.mass_check import excess_remark
    from porotwin_imaging.mass_course import jump_remark
    from porotwin_imaging.well_check import pale_well_remark
    from porotwin_recording.concentration import open_maps

    if rates is None:
        return dict.fromkeys(('out_of_course', 'too_much_tracer', 'pale_well'))
    maps = open_maps(output, rig)
    times = maps.times.tolist()
    excess = (excess_remark(maps[index], time, rig, rates) for index, time in enumerate(times))
    return {
        'out_of_course': jump_remark(maps, times, photos, rig, rates) or None,
        'too_much_tracer': next(filter(None, excess), None),
        'pale_well': pale_well_remark(maps, times, rig, rates) or None,
    }


def _tell_cost(photo: 'Photo', rig: 'Rig', grid: 'Grid') -> float:
    """Return the memory of one map [B]; tell the cost of the maps if a photograph takes long."""
    from porotwin_cli.many_photos import read_photo
    from porotwin_imaging.imaging_cost import map_cost
    from porotwin_imaging.photo_file import photo_size

    cost = map_cost(rig, grid, photo_size(read_photo(photo)))
    if cost.seconds > LONG_S:
        say(f'grid {grid}: {cost}; a coarser --grid is faster')
    return cost.memory_bytes


def _draw(picture: Path, output: Path, rig: 'Rig', *, calibrated: bool) -> None:
    """Draw some of the maps in the file `output` into `picture`."""
    from porotwin_cli.rig_drawing import chosen_maps, sheet_of_maps
    from porotwin_recording.concentration import open_maps

    maps = open_maps(output, rig)
    shown = chosen_maps(len(maps.times))
    scale = 'calibrated' if calibrated else 'uncalibrated'
    times = [float(maps.times[index]) for index in shown]
    pictured = [maps[index] for index in shown]
    sheet_of_maps(picture, rig, times, pictured, f'{output.name}, {scale}', command='image')
