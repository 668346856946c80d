"""./porotwin replay: a bag into the running graph, with /clock."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.options.rig_choice import Domain, Namespace
from porotwin_cli.running.foreground import run_node
from porotwin_cli.terminal import Json, print_json
from porotwin_core.basis.errors import InputError
from porotwin_hub.launching.graph import NAMESPACE, Parameter


def command(
    bag: Annotated[Path, typer.Argument(help='MCAP file or bag folder.')],
    rate: Annotated[
        float,
        typer.Option(
            help='Speed relative to real time. 0: as fast as possible.', min=0.0, max=1000.0
        ),
    ] = 1.0,
    start: Annotated[float, typer.Option(help='Time in the bag to start from [s].', min=0.0)] = 0.0,
    loop: Annotated[bool, typer.Option(help='Start again at the end.')] = False,
    topics: Annotated[
        str, typer.Option(help="Topic names, 'inputs' (messages from the rig) or 'all'.")
    ] = 'inputs',
    lock_step: Annotated[
        bool, typer.Option(help='Wait for the answer of the twin after each photograph.')
    ] = False,
    namespace: Namespace = NAMESPACE,
    domain: Domain = None,
    as_json: Json = False,
) -> None:
    """Play a bag into the running graph, which ./porotwin up --replay starts.

    The graph receives photographs, measured rates and the time as from a rig. In lock-step, the
    same bag gives the same maps, predictions and setpoints on any machine.

    Example: ./porotwin replay bags/sample --rate 20
    """
    if not bag.exists():
        raise InputError(f'{bag}: no such bag; name an .mcap file or a bag folder')
    parameters: dict[str, Parameter] = {
        'bag': str(bag.resolve()),
        'rate': rate,
        'start_s': start,
        'loop': loop,
        'topics': topics,
        'lockstep': 'hub/cycle' if lock_step else '',
    }
    run_node(
        'porotwin_recording.player_node',
        'player',
        parameters,
        namespace=namespace,
        domain=domain,
    )
    if as_json:
        print_json(parameters)
