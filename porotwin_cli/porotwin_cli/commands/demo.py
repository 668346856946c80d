"""./porotwin demo: the paper's control experiment in a closed loop with a virtual rig."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.options.seed_option import seed_option
from porotwin_cli.terminal import Json, duration_in_words, print_json, say
from porotwin_cli.workspace import run_folder, small_rig
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, MINUTE_S
from porotwin_core.model.preset_names import PRESET_WORDS
from porotwin_core.ros.ros_environment import prepare_environment

ASKING_SPEED = '10'
"""Usual speed if a person answers the offers: a photograph every three seconds."""


def command(
    rig: Annotated[
        Path | None,
        typer.Option(
            help='rig.yaml of your rig, or a folder with it: the twin controls it from the start. '
            'Default: the small rig of the paper.'
        ),
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(
            help='Time under control [min]; the paper has 80. From 60 on the twin controls from '
            'the start. Below 60 the tracer first spreads without control, for the larger of 20 '
            'min and 36 min minus this time. Default: 30; with a hidden effect 40; with another '
            'rig until its control.end_min, or 80.',
            min=1.0,
            max=LONGEST_EXPERIMENT_S / MINUTE_S,
        ),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(
            help="'max', or the speed relative to real time. Default: max; "
            f'{ASKING_SPEED} with --ask.'
        ),
    ] = None,
    seed: Annotated[int, seed_option('Seed of sand, camera and training.')] = 7,
    hidden_effect: Annotated[
        str,
        typer.Option(
            help="Effect of the rig that the twin does not know: 'surprise', a name, or "
            'NAME:PARAM=VALUE,... (docs/mend.md).'
        ),
    ] = '',
    ask: Annotated[
        bool,
        typer.Option(
            '--ask', help='Leave the answers to offers to you: on the page, or ./porotwin mend.'
        ),
    ] = False,
    costa: Annotated[
        bool | None,
        typer.Option(
            help='Train COSTA on other experiments first, and use it. Default: on the small rig, '
            'unless an effect is hidden.'
        ),
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help='Preset of the physics-based model: upwind is too diffusive, as in the paper; '
            f'fast is not. All: {PRESET_WORDS}. Default: upwind; fast with a hidden '
            'effect or another rig.'
        ),
    ] = None,
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

    With --rig it shows what the twin would do on your rig, before you build or fill it. The fixed
    wells make the pauses of rig.yaml and of a rates.csv beside it.

    Example: ./porotwin demo --rig rigs/two_sands --minutes 60

    With --hidden-effect the rig differs from its description. The running twin diagnoses the
    difference and offers a correction, which an automatic operator accepts. With --ask you answer.

    Example: ./porotwin demo --minutes 80 --page 0.0.0.0:8765

    Example: ./porotwin demo --hidden-effect surprise

    Example: ./porotwin demo --hidden-effect surprise --ask
    """
    prepare_environment()
    from porotwin_cli.options.planned_rig import planned_rig
    from porotwin_cli.running.closed_loop import DemoSettings, run_demo, show_figures, usual_minutes
    from porotwin_cli.running.hidden_effect import hidden_effect as draw_hidden
    from porotwin_core.rig import load_rig

    if ask and not hidden_effect:
        raise InputError('--ask: without a --hidden-effect there is no offer to answer; give one')
    own = planned_rig(rig) if rig else None
    described = own or load_rig(small_rig())
    hidden = draw_hidden(hidden_effect, described, seed=seed) if hidden_effect else None
    settings = DemoSettings(
        minutes=minutes or usual_minutes(own, hidden=hidden is not None),
        speed=speed or (ASKING_SPEED if ask else 'max'),
        ask=ask,
        seed=seed,
        costa=hidden is None and rig is None if costa is None else costa,
        preset=preset or ('fast' if hidden or rig else 'upwind'),
        hidden=hidden,
        photo_width=photo_width,
        page='' if no_page else page,
        rig=own,
    )
    settings.check()
    folder = run_folder(output, 'demo')
    say(
        f'demo: {settings.minutes:g} min of the rig {described.name}, '
        f'{settings.photographs} photographs, into {folder}'
    )
    if hidden_effect:
        say('the rig has an effect that the twin does not know')
    if settings.start_minute > 0.0:
        say(f'the twin takes over {settings.start_minute:g} min after the start of the injection')
    say(f'this takes about {duration_in_words(settings.expected_seconds())} on two cores')
    figures = run_demo(settings, folder)
    if as_json:
        print_json({**figures, 'output': folder})
    else:
        show_figures(figures, folder)
