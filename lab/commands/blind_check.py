"""./porotwin blind-check: the diagnosis on recordings whose truth is hidden from it."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from porotwin_cli.options.crew_options import Scheduler, Workers
from porotwin_cli.options.seed_option import seed_option
from porotwin_cli.terminal import Json, print_json, progress, say
from porotwin_core.basis.errors import InputError


def command(
    output: Annotated[
        Path, typer.Option(help='Folder for cases and report. A second call continues there.')
    ],
    cases: Annotated[int, typer.Option(help='Number of recordings.', min=1)] = 20,
    seed: Annotated[int, seed_option('Seed of the random effects and rigs.')] = 1,
    source: Annotated[
        Literal['maps', 'photographs'],
        typer.Option(
            '--from', help='Maps with noise, or photographs that are calibrated and imaged.'
        ),
    ] = 'maps',
    baseline: Annotated[
        Path | None,
        typer.Option(help='Experiment folder with a photograph of a real rig as background.'),
    ] = None,
    several: Annotated[
        bool, typer.Option(help='Only cases with three effects, or with two of one kind.')
    ] = False,
    coarse: Annotated[
        bool, typer.Option(help='Cells twice as large: about five times faster.')
    ] = False,
    workers: Workers = None,
    scheduler: Scheduler = '',
    as_json: Json = False,
) -> None:
    """Score the diagnosis on recordings with hidden effects.

    The virtual rig makes recordings with random effects, and the diagnosis has to find them. The
    hashes of all hidden effects are written before the first diagnosis. The process that diagnoses
    gets the folder of a recording and nothing else.

    With --from photographs, the virtual rig is photographed with all disturbances of its camera. A
    known injection on the same flawed rig gives the calibration, and imaging makes the maps. With
    --baseline, the tracer is composed on the photograph of a real rig.

    Example: ./porotwin blind-check --cases 100 --output blind --workers 8

    Example: ./porotwin blind-check --from photographs --cases 20 --output seen
    """
    if baseline is not None and source != 'photographs':
        raise InputError('--baseline: only with --from photographs; maps need no photograph')
    from functools import partial

    from lab.blind.blind_cases import KINDS, SEVERAL, draw_case
    from lab.blind.blind_study import blind_check

    with progress() as bar:
        task = bar.add_task('cases', total=cases)
        figures = blind_check(
            output,
            cases=cases,
            seed=seed,
            workers=workers,
            scheduler=scheduler,
            tell=say,
            progress=lambda done, _, stage: bar.update(task, completed=done, description=stage),
            draw=partial(draw_case, kinds=SEVERAL if several else KINDS, coarse=coarse),
            source=source,
            baseline=baseline,
        )
    if as_json:
        print_json({'output': output, **figures})
        return
    print((output / 'report.md').read_text(encoding='utf-8'))
    say(f'table and confusion matrix: {output / "report.md"}')
