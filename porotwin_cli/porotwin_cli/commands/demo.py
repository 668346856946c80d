"""./porotwin demo: the paper's control experiment in a closed loop with a virtual rig."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.terminal import Json, duration_in_words, print_json, say
from porotwin_cli.workspace import run_folder
from porotwin_core.ros_environment import prepare_environment


def command(
    minutes: Annotated[
        float,
        typer.Option(
            help='Time under control [min]; 80 as in the paper. Below 60, the tracer has spread '
            'for 20 min or more before the twin takes over.',
            min=1.0,
        ),
    ] = 30.0,
    speed: Annotated[
        str, typer.Option(help="'max', or how many times faster than the laboratory.")
    ] = 'max',
    seed: Annotated[int, typer.Option(help='Seed of sand, camera and training.')] = 7,
    costa: Annotated[
        bool, typer.Option(help='Train COSTA on other experiments first, and use it.')
    ] = True,
    preset: Annotated[
        str,
        typer.Option(
            help='Preset of the physics-based model: upwind is too diffusive, as in the paper; '
            'fast is not.'
        ),
    ] = 'upwind',
    photo_width: Annotated[
        int, typer.Option(help='Width of the photographs [px].', min=400)
    ] = 1600,
    page: Annotated[str, typer.Option(help='HOST:PORT of the page to watch.')] = '127.0.0.1:8765',
    no_page: Annotated[bool, typer.Option('--no-page', help='Serve no page.')] = False,
    output: Annotated[
        Path | None, typer.Option(help='Folder for all results. Default: in runs/.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Run the closed loop with a virtual rig.

    This is the experiment of the paper's section 4: the twin pumps water into control wells to keep
    tracer out of a zone. Every node is a process of its own. The virtual rig waits for the twin, so
    the result does not depend on the speed of the machine. Everything is recorded into a bag.

    Example: ./porotwin demo

    Example: ./porotwin demo --minutes 80 --page 0.0.0.0:8765
    """
    prepare_environment()
    from porotwin_cli.closed_loop import DemoSettings, run_demo, show_figures

    settings = DemoSettings(
        minutes=minutes,
        speed=speed,
        seed=seed,
        costa=costa,
        preset=preset,
        photo_width=photo_width,
        page='' if no_page else page,
    )
    settings.check()
    folder = run_folder(output, 'demo')
    say(
        f'demo: {minutes:g} min of the small rig, {settings.photographs} photographs, into {folder}'
    )
    if settings.start_minute > 0.0:
        say(f'the twin takes over {settings.start_minute:g} min after the start of the injection')
    say(f'this takes about {duration_in_words(settings.expected_seconds())} on two cores')
    figures = run_demo(settings, folder)
    if as_json:
        print_json({**figures, 'output': folder})
    else:
        show_figures(figures, folder)
