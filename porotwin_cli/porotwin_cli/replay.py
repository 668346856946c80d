"""./porotwin replay: a bag into the running graph, with /clock."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.foreground import run_node
from porotwin_core.errors import InputError


def command(
    bag: Annotated[Path, typer.Argument(help='MCAP file or bag folder.')],
    rate: Annotated[float, typer.Option(help='Times real time; 0: as fast as possible.')] = 1.0,
    start: Annotated[float, typer.Option(help='Seconds into the bag to start at.', min=0.0)] = 0.0,
    loop: Annotated[bool, typer.Option(help='Begin again at the end.')] = False,
    all_topics: Annotated[
        bool, typer.Option('--all', help='Play all topics, not only what came from the rig.')
    ] = False,
) -> None:
    """Play a bag into the graph: photographs and measured rates as if they came from the rig.

    Example: ./porotwin replay bags/sample --rate 20
    """
    if not bag.exists():
        raise InputError(f'{bag}: no such bag; name an .mcap file or a bag folder')
    parameters = {'bag': str(bag.resolve()), 'rate': rate, 'start': start, 'loop': loop}
    run_node('porotwin_recording.player_node', 'player', {**parameters, 'all_topics': all_topics})
