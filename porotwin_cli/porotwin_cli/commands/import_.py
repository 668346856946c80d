"""./porotwin import: an experiment folder into a bag, or data of other programs into a folder."""

import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from porotwin_cli.recorded.conversion import convert
from porotwin_cli.terminal import Json, as_argument, print_json, refuse_existing, refuse_inside, say
from porotwin_core.basis.errors import InputError

if TYPE_CHECKING:
    from porotwin_core.rig import Rig

MAP_OPTIONS = ('--rig', '--decimal', '--time-unit', '--first-row', '--stock', '--no-value')
"""Options for a file of maps."""

PROTOCOL_OPTIONS = (
    '--rig',
    '--date-order',
    '--date-numbers',
    '--clock',
    '--time-zone',
    '--decimal',
    '--rate-unit',
    '--concentration',
    '--camera-ahead',
    '--time-zero',
)
"""Options for a folder with protocols or photographs."""


def command(
    source: Annotated[
        Path,
        typer.Argument(
            help='Experiment folder, folder with protocols or photographs, file of maps, or an '
            'archive (zip, tar, gz, bz2, xz) of one.'
        ),
    ],
    target: Annotated[Path, typer.Argument(help='Bag or experiment folder to write.')],
    rig: Annotated[
        Path | None,
        typer.Option(help='rig.yaml of the rig. Default: beside the data.'),
    ] = None,
    date_order: Annotated[
        Literal['day-first', 'month-first'] | None,
        typer.Option(help='Order of day and month in dates such as 3/4/2024.'),
    ] = None,
    date_numbers: Annotated[
        Literal[
            'excel-1900',
            'excel-1904',
            'matlab',
            'unix-s',
            'unix-ms',
            'unix-us',
            'unix-ns',
            'labview',
        ]
        | None,
        typer.Option(help='What numbers in place of dates count.'),
    ] = None,
    clock: Annotated[
        Literal['12h-am', '12h-pm'] | None,
        typer.Option(
            help='12-hour clock without am and pm: the half of the day in which the log begins.'
        ),
    ] = None,
    time_zone: Annotated[
        str, typer.Option(help='Time zone for times without one, such as Europe/Oslo.')
    ] = '',
    decimal: Annotated[
        Literal['point', 'comma'] | None, typer.Option(help='Decimal sign of numbers.')
    ] = None,
    rate_unit: Annotated[str, typer.Option(help='Unit of rates, such as ml/min.')] = '',
    concentration: Annotated[
        str,
        typer.Option(
            help='Concentration of injected fluids without a column, from 0 (water) to 1: one for '
            'all wells, or dye=1,water=0.'
        ),
    ] = '',
    camera_ahead: Annotated[
        float, typer.Option(help="Lead of the camera's clock over the clock of the pumps [s].")
    ] = 0.0,
    time_zero: Annotated[
        str,
        typer.Option(
            help='Date and time of second 0 of rates.csv, by the clock of the pumps, such as '
            "'2024-05-31 14:30:00'."
        ),
    ] = '',
    time_unit: Annotated[str, typer.Option(help='Unit of the times of maps, such as min.')] = '',
    first_row: Annotated[
        Literal['top', 'bottom'] | None, typer.Option(help='Place of the first row of a map.')
    ] = None,
    stock: Annotated[
        float | None, typer.Option(help='Value of tracer stock in maps, such as 100 for percent.')
    ] = None,
    no_value: Annotated[
        float | None, typer.Option(help='Number that stands for no value in maps, such as 999.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Convert an experiment folder into an MCAP bag, or data of other programs into a folder.

    Other programs: a folder with imaging_protocol.csv and injection_protocol.csv, as DarSIA uses
    them, measured_protocol.csv, the log of a flow meter, and level_protocol.csv, that of water
    levels; or maps in a file .npz, .csv, .nc,
    .mat or .tif, or a folder .zarr. Photographs that no imaging_protocol.csv lists have the times
    that the camera wrote into them (EXIF), or into their names. They may lie beside a rates.csv,
    whose second 0 --time-zero dates. The command asks for missing facts, and proposes the answers
    with which it can read all.

    Example: ./porotwin import experiment experiment_bag

    Example: ./porotwin import lab_folder experiment --rig rig.yaml --date-order day-first
    """
    from porotwin_core.basis.photo_list import IMAGING_FILE
    from porotwin_imaging.photograph.exposure_time import exif_words
    from porotwin_recording.experiment.bag_conversion import import_experiment
    from porotwin_recording.experiment.experiment_folder import RIG_FILE
    from porotwin_recording.importers.map_import import MapAnswers, import_maps, maps_in
    from porotwin_recording.importers.packed import opened_archive
    from porotwin_recording.importers.protocol_answers import ProtocolAnswers, concentration_in
    from porotwin_recording.importers.protocol_import import import_protocols, is_lab_folder
    from porotwin_recording.mcap.bag_folder import is_bag
    from porotwin_recording.tables.one_writer import one_writer

    given = {
        '--rig': rig,
        '--date-order': date_order,
        '--date-numbers': date_numbers,
        '--clock': clock,
        '--time-zone': time_zone,
        '--decimal': decimal,
        '--rate-unit': rate_unit,
        '--concentration': concentration,
        '--camera-ahead': camera_ahead,
        '--time-zero': time_zero,
        '--time-unit': time_unit,
        '--first-row': first_row,
        '--stock': stock,
        '--no-value': no_value,
    }
    if not source.exists():
        raise InputError(f'{source}: no such file or folder')
    refuse_inside(source, target)
    with opened_archive(source) as opened:
        data = opened if opened.is_dir() and is_lab_folder(opened) else maps_in(opened)
        is_experiment = data.name == RIG_FILE or is_bag(data)
        has_maps = data.suffix == '.zarr' or (data.is_file() and not is_experiment)
        if has_maps:
            _refuse_others(given, MAP_OPTIONS, f'{source}: a file of maps')
        elif data.is_dir() and is_lab_folder(data):
            _refuse_others(
                given, PROTOCOL_OPTIONS, f'{source}: a folder with protocols or photographs'
            )
        else:
            listed = not data.is_dir() or (data / IMAGING_FILE).exists()
            kind = 'an experiment' if listed else 'has no photographs and no protocols, and'
            _refuse_others(given, (), f'{source}: {kind}')
            convert(import_experiment, data, target, as_json=as_json)
            return
        refuse_existing(target)
        with one_writer(target), _absent_after_error(target):
            if has_maps:
                maps = MapAnswers(time_unit, first_row, stock, decimal, no_value)
                described = _rig((data.parent, opened, source.parent), rig)
                told = import_maps(data, target, described, maps)
            else:
                answers = ProtocolAnswers(
                    date_order,
                    time_zone,
                    decimal,
                    rate_unit,
                    concentration_in(concentration),
                    camera_ahead,
                    time_zero,
                    date_numbers,
                    clock,
                )
                beside = (data,) if data == source else (data, source.parent)
                described = _rig(beside, rig)
                told = import_protocols(data, target, described, answers, exposure=exif_words)
            told = [line.replace(str(opened), str(source)) for line in told]
            for line in told:
                say(line)
            _report(source, target, told, as_json=as_json)


def _refuse_others(given: Mapping[str, object], used: Collection[str], source: str) -> None:
    """Refuse options that were given and are not `used`, so that nobody believes that they act.

    Raises:
        InputError: there is one; the line begins with the words for the `source`.
    """
    unset = (None, '', 0.0)
    others = [name for name, value in given.items() if value not in unset and name not in used]
    if others:
        raise InputError(
            f'{source} takes no {" and no ".join(others)}; leave it out, or add its data'
        )


@contextmanager
def _absent_after_error(target: Path) -> Iterator[None]:
    """Remove `target` after an error of the block, so that a second call does not find it."""
    try:
        yield
    except BaseException:
        shutil.rmtree(target, ignore_errors=True)
        raise


def _rig(folders: Sequence[Path], path: Path | None) -> 'Rig':
    """Return the rig of foreign data, from `path` or the first of `folders` that describes it.

    Raises:
        InputError: there is none.
    """
    from porotwin_core.rig import load_rig

    described = [folder for folder in folders if (folder / 'rig.yaml').is_file()]
    if path is None and not described:
        raise InputError(f'{folders[-1]}: has no rig.yaml; give --rig, the description of the rig')
    return load_rig(path or described[0])


def _report(source: Path, target: Path, told: list[str], *, as_json: bool) -> None:
    """Print the name and the content of the new recording.

    Raises:
        InputError: it is no experiment that other commands accept; `source` is named.
    """
    from porotwin_checks.all_checks import OF_MAPS, OF_RIG
    from porotwin_recording.experiment.experiment_folder import MAPS_FILE
    from porotwin_recording.experiment.recording import odd_lines, open_recording

    try:
        made = open_recording(target)
    except InputError as error:  # it names files that are removed again
        reason = str(error).replace(f'{target}/', '').removeprefix(f'{target}: ')
        raise InputError(f'{source}: makes no valid experiment folder: {reason}') from None
    for line in odd_lines([made], OF_MAPS | OF_RIG):
        say(line)
    maps, photographs = len(made.maps) if made.maps is not None else 0, len(made.photos)
    if as_json:
        print_json({'output': target, 'maps': maps, 'photographs': photographs, 'told': told})
    else:
        rows = f', {len(made.delivered.rows)} rates' if made.known_rates else ''
        print(f'{target}: {maps} maps, {photographs} photographs{rows}')
        there, maps_file = (as_argument(path) for path in (target, target / MAPS_FILE))
        image = f'./porotwin image {there} --output {maps_file} makes its maps'
        say(f'next: ./porotwin check {there}' + (f'; {image}' if photographs and not maps else ''))
