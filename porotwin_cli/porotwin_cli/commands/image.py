"""./porotwin image: photographs to concentration maps."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from porotwin_cli.options.crew_options import Scheduler, Workers
from porotwin_cli.options.output_files import one_call_for_each_output
from porotwin_cli.terminal import Json, print_json, refuse_existing, say
from porotwin_core.basis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from porotwin_cli.photographs.imaged_maps import ExperimentPhotos
    from porotwin_core.geometry.grid import Grid
    from porotwin_core.rig import Rig
    from porotwin_imaging.tracer.calibration import Calibration
    from porotwin_recording.experiment.recording import Recording

UNCALIBRATED = (
    'uncalibrated: the plume is where it is shown, but the concentrations are on a default scale; '
    './porotwin calibrate measures the scale from a known injection'
)

ON_A_RELATIVE_SCALE = (
    'relative: the core of the plume counts as 1, and nothing tells its concentration; fronts, '
    'outlines and times of arrival hold, amounts of tracer do not'
)


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
    relative: Annotated[
        bool,
        typer.Option(
            '--relative',
            help='No calibration can be had: scale the maps from 0 to 1 by the core of the plume. '
            'Fronts and times of arrival hold, amounts of tracer do not.',
        ),
    ] = False,
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
    from porotwin_checks.all_checks import OF_MAPS, OF_PHOTOGRAPHS, OF_RIG, remarks_about
    from porotwin_cli.options.grids import grid_of
    from porotwin_cli.options.output_files import check_output, maker, maps_are_kept
    from porotwin_cli.photographs.imaged_maps import ExperimentPhotos, write_maps
    from porotwin_cli.photographs.map_sureness import (
        doubt_entry,
        guessed_sands,
        sureness_words,
        typical_doubt,
    )
    from porotwin_cli.pictures.rig_drawing import picture_beside
    from porotwin_core.basis.errors import writing
    from porotwin_core.basis.parallel import crew
    from porotwin_core.basis.whole_folder import whole_folder
    from porotwin_imaging.baseline.baseline import make_baseline
    from porotwin_imaging.baseline.covered_baseline import uncovered
    from porotwin_imaging.calibrating.relative_scale import relative_calibration
    from porotwin_imaging.photograph.file_hash import sha256_of_file
    from porotwin_imaging.photograph.photo_file import MOST_PIXELS
    from porotwin_imaging.tracer.calibration import RELATIVE, load_calibration, save_calibration
    from porotwin_recording.experiment.photo_source import fingerprints
    from porotwin_recording.experiment.recording import open_recording
    from porotwin_recording.tables.concentration import VIRTUAL, MapOrigin, open_maps
    from porotwin_recording.tables.map_parts import MapParts

    picture = picture_beside(output)
    for path in (output, picture):
        check_output(path, experiment, calibration, command='image', named=path == output)
    _check_learnt(learnt, calibration)
    if relative and calibration:
        raise InputError('--relative is for maps without a calibration; leave out one of both')
    recording = open_recording(experiment)
    rig = recording.rig
    map_grid = grid_of(grid, rig, MOST_PIXELS)
    photos = ExperimentPhotos.of(recording, experiment)
    memory = _memory(photos, rig, map_grid)
    origin = MapOrigin(
        calibration is not None,
        sha256_of_file(calibration),
        maker(f'image, {VIRTUAL}' if recording.is_virtual else 'image'),
        RELATIVE if relative else '',
    )
    clean = [photo.read() for photo in photos.baselines]
    source = fingerprints(recording)
    used, corrected = None, 0
    if calibration:
        given = load_calibration(calibration)
        source['pictures of the calibration'] = given.picture_fingerprint
        used, corrected = _refined(given, recording, photos, clean, experiment.name)
    baseline = make_baseline(rig, map_grid, clean, calibration=used, names=photos.baseline_files)
    baseline, cover = uncovered(
        baseline, [photo.read for photo in photos.states], photos.baseline_files
    )
    if relative:
        reads = [photo.read for photo in photos.states]
        baseline = replace(baseline, calibration=relative_calibration(baseline, reads))
    covered = (cover,) if cover else ()
    for line in (*baseline.remarks, *map(str, covered)):
        say(line)
    pool = crew(workers=workers, scheduler=scheduler, threads=True, task_bytes=memory, tell=say)
    parts = MapParts(output, rig, map_grid, source=source, origin=origin)
    made = write_maps(parts, rig, photos.states, baseline, pool)
    scale = 'calibrated' if calibration else 'relative scale' if relative else 'uncalibrated'
    with maps_are_kept(output):
        if learnt and used:  # not before, because a call that goes on would find it
            with writing(learnt), whole_folder(learnt) as unfinished:
                save_calibration(used, unfinished / 'calibration.yaml')
            say(_learnt_words(learnt, corrected))
        _draw(picture, output, rig, scale)
    names = [str(entry['photo']) for entry in made.entries]
    imaged = replace(recording, maps=open_maps(output, rig))
    known = replace(imaged.known(names), seen_photos=made.seen)
    odd = remarks_about(known, OF_PHOTOGRAPHS | OF_MAPS | OF_RIG)
    for remark in odd:
        say(str(remark))
    known_factors = used.factor_deviations if used else ()
    if as_json:
        print_json(
            {
                'output': output,
                'picture': picture,
                'grid': str(map_grid),
                'calibrated': calibration is not None,
                'relative': relative,
                'plume': doubt_entry(typical_doubt(made.doubts)),
                'guessed_sands': guessed_sands(known_factors) if used else None,
                'maps': made.entries,
                'refused': made.refused,
                'same_files': [run for one in odd for run in one.facts.get('runs', ())],
                'remarks': [asdict(remark) for remark in (*covered, *odd)],
            }
        )
        return
    print(
        f'{len(made.entries)} maps on {map_grid} in {output}, {len(made.refused)} photographs '
        'refused'
    )
    for line in sureness_words(made.doubts, known_factors):
        print(line)
    print(f'picture: {picture}')
    if calibration is None:
        print(ON_A_RELATIVE_SCALE if relative else UNCALIBRATED)


def _refined(
    calibration: 'Calibration',
    recording: 'Recording',
    photos: 'ExperimentPhotos',
    clean: 'Sequence[bytes]',
    source: str,
) -> 'tuple[Calibration, int]':
    """Return `calibration` with factors learnt from the plumes, and their number; tell them.

    Args:
        calibration: the given calibration.
        recording: the experiment.
        photos: its photographs.
        clean: bytes of the baselines.
        source: name of the experiment.
    """
    from porotwin_imaging.calibrating.sand_refinement import refined

    better = refined(
        calibration,
        recording.rig,
        clean,
        [(photo.time, photo.read) for photo in photos.states],
        recording.known().rates,
        source=source,
        baseline_names=photos.baseline_files,
    )
    for line in better.lines:
        say(line)
    return better.calibration, len(better.lines)


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


def _memory(photos: 'ExperimentPhotos', rig: 'Rig', grid: 'Grid') -> float:
    """Return the memory of one map [B].

    Raises:
        InputError: the first baseline is no photograph; its file is named.
    """
    from porotwin_cli.photographs.many_photos import read_photo
    from porotwin_imaging.geometry.imaging_cost import map_cost
    from porotwin_imaging.photograph.photo_file import photo_size
    from porotwin_imaging.photograph.photo_names import named

    with named(photos.baseline_files[0]):
        cost = map_cost(rig, grid, photo_size(read_photo(photos.baselines[0])))
    return cost.memory_bytes


def _draw(picture: Path, output: Path, rig: 'Rig', scale: str) -> None:
    """Draw some of the maps in the file `output`, of a `scale` in words, into `picture`."""
    from porotwin_cli.pictures.rig_drawing import chosen_maps, sheet_of_maps
    from porotwin_recording.tables.concentration import open_maps

    maps = open_maps(output, rig)
    shown = chosen_maps(len(maps.times))
    times = [float(maps.times[index]) for index in shown]
    pictured = [maps[index] for index in shown]
    sheet_of_maps(picture, rig, times, pictured, f'{output.name}, {scale}', command='image')
