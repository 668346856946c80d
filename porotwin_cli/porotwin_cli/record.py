"""./porotwin record: everything that a running graph says, into a bag."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.foreground import run_node
from porotwin_cli.output import refuse_existing, say


def command(
    output: Annotated[Path, typer.Option(help='Bag folder to write.')],
) -> None:
    """Record the running graph until Ctrl-C.

    Example: ./porotwin record --output runs/today
    """
    refuse_existing(output)
    say(f'recording into {output}; stop with Ctrl-C')
    run_node('porotwin_recording.recorder_node', 'recorder', {'output': str(output.resolve())})
