"""./porotwin export: a bag into an experiment folder."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.conversion import convert
from porotwin_cli.terminal import Json, say


def command(
    bag: Annotated[Path, typer.Argument(help='MCAP file or bag folder.')],
    folder: Annotated[Path, typer.Argument(help='Experiment folder to write.')],
    segment: Annotated[
        int | None,
        typer.Option(help='Which experiment, if the bag holds several. Default: the longest.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Convert an MCAP bag into an experiment folder.

    The folder holds the experiment only. The command names the topics that it leaves out.

    Example: ./porotwin export bags/sample sample_experiment
    """
    from porotwin_recording.bag_conversion import export_bag, topics_left_out

    convert(partial(export_bag, segment=segment), bag, folder, as_json=as_json)
    left_out = topics_left_out(bag)
    if left_out:
        counts = ', '.join(f'{name} ({count})' for name, count in left_out.items())
        say(f'left out, because a folder has no place for them: {counts}')
