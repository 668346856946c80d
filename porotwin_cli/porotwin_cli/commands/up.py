"""./porotwin up: the twin beside the rig, until stopped."""

import os
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from porotwin_cli.options.graph_options import graph_options
from porotwin_cli.options.rig_choice import Domain, Namespace
from porotwin_cli.terminal import Json, print_json, say
from porotwin_cli.workspace import run_folder
from porotwin_core.basis.errors import InputError
from porotwin_hub.launching.graph import GraphSettings, description_of

if TYPE_CHECKING:
    from porotwin_core.rig import Rig


class Mend(StrEnum):
    """Whether effects that a diagnosis finds are offered."""

    ASK = 'ask'
    OFF = 'off'


def _print_template(wanted: bool) -> None:
    """Print the template of a parameter file and end, if it is wanted."""
    if wanted:
        from porotwin_hub.launching.graph import parameter_template

        print(parameter_template(), end='')
        raise typer.Exit


@graph_options(
    without=(
        'control',
        'diagnoses',
        'evaluations',
        'page_token',
        'record',
        'training',
        'use_sim_time',
    ),
    defaults={'page': '127.0.0.1:8765', 'siblings': True},
)
def command(
    settings: GraphSettings,
    *,
    replay: Annotated[
        bool, typer.Option('--replay', help='Photographs and time come from ./porotwin replay.')
    ] = False,
    _template: Annotated[
        bool,
        typer.Option(
            '--params-template',
            help='Print a parameter file with all parameters, their defaults and meanings.',
            callback=_print_template,
            is_eager=True,
        ),
    ] = False,
    predict_only: Annotated[bool, typer.Option(help='Never choose setpoints.')] = False,
    diagnosis: Annotated[
        bool, typer.Option(help='Offer diagnoses of the run so far: ./porotwin diagnose --live.')
    ] = True,
    mend: Annotated[
        Mend | None,
        typer.Option(
            help=f'{description_of("mend")} Default: ask; off with --no-diagnosis or --replay.'
        ),
    ] = None,
    namespace: Namespace = '',
    domain: Domain = None,
    output: Annotated[
        Path | None, typer.Option(help='Folder for bag, logs and training. Default: in runs/.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Start the twin beside the rig.

    The twin turns photographs into maps, predictions and setpoints, and records everything. Stop it
    with Ctrl-C.

    Example: ./porotwin up --rig rig.yaml --photos /mnt/camera --page 0.0.0.0:8765
    """
    from porotwin_cli.options.grids import grid_of
    from porotwin_cli.options.planned_rig import planned_rig
    from porotwin_cli.running.live_twin import check_early, run_until_stopped
    from porotwin_cli.running.pace import tell_pace
    from porotwin_core.ros.ros_environment import (
        DomainClaim,
        domain_of,
        enter_domain,
        namespace_of,
        prepare_environment,
    )
    from porotwin_hub.launching.graph import live_graph, named_nodes
    from porotwin_hub.launching.network import network_of
    from porotwin_imaging.sources.source_registry import check_source
    from porotwin_imaging.tracer.calibration import copy_calibration
    from porotwin_page.address import settled
    from porotwin_pumps.pump_file import load_pumps

    network = network_of(settings.params)
    os.environ.update(network.environment())
    enter_domain(domain)
    prepare_environment()
    rig_file = settings.rig / 'rig.yaml' if settings.rig.is_dir() else settings.rig
    rig = planned_rig(rig_file)
    here = named_nodes(settings.nodes)
    photos, pumps = settings.photos, settings.pumps
    sources = [photos is not None, bool(settings.camera), replay].count(True)
    if (not here or 'camera' in here) and sources != 1:
        raise InputError('name either --photos FOLDER or --camera SOURCE, or --replay for a bag')
    if mend is Mend.ASK and not diagnosis:
        raise InputError('--mend ask needs the diagnosis; leave out --no-diagnosis')
    if photos is not None and not photos.is_dir():
        raise InputError(f'{photos}: no such folder of photographs; create it or name another')
    if rig.camera is None:
        raise InputError(
            f'{rig_file}: has no camera section; add the corners of the rig in the photographs, '
            'such as camera: {corners_px: [[100, 80], [100, 1020], [1500, 1020], [1500, 80]]} '
            '(docs/rig.md, Camera)'
        )
    page = '' if here and 'page' not in here else settings.page
    settings = replace(settings, page=page)
    cells = grid_of(settings.grid, rig)
    check_early(settings, rig, cells)
    tell_pace(rig, cells, settings.preset, settings.photo_interval_s)
    if pumps is not None:
        load_pumps(pumps, rig)
    if settings.camera:
        check_source(settings.camera)
    settings = replace(
        settings,
        rig=rig_file.resolve(),
        photos=photos.resolve() if photos is not None else None,
        pumps=pumps.resolve() if pumps is not None else None,
        control=not predict_only,
        mend=mend or (Mend.ASK if diagnosis and not replay else Mend.OFF),
        page=settled(page) if page else '',
        namespace=namespace_of(namespace or network.namespace or GraphSettings.namespace),
        use_sim_time=replay,
    )
    live_graph(settings)  # refuses a wrong parameter file
    with DomainClaim(domain_of(os.environ)):
        folder = run_folder(output, 'up')
        settings = replace(
            settings,
            rig=_kept(rig, folder / 'rig'),
            training=folder / 'training' if settings.retrain_every else None,
            record=None if here and 'recorder' not in here else folder / 'bag',
            diagnoses=folder / 'diagnoses' if diagnosis else None,
            page_token=folder / 'page_token' if page else None,
        )
        if settings.calibration is not None:
            copy_calibration(settings.calibration, folder / 'calibration')
        say(f'{rig_file}: copied into {folder / "rig"}; changes act from the next start on')
        run_until_stopped(settings, folder)
    begun = settings.record is not None and settings.record.exists()
    bag = settings.record if begun else None  # none if it was stopped before the recorder ran
    if as_json:
        print_json({'output': folder, 'bag': bag, 'logs': folder / 'log'})
    else:
        print(f'recorded in {bag}' if bag else f'logs in {folder}')


def _kept(rig: 'Rig', folder: Path) -> Path:
    """Write the description into `folder` and return its file.

    A node that starts again reads what the others have read, whatever happens to the first file.
    """
    from porotwin_core.rig import write_rig

    folder.mkdir()
    write_rig(rig, folder / 'rig.yaml')
    return folder / 'rig.yaml'
