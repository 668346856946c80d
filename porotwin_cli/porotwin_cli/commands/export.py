"""./porotwin export: a bag into an experiment folder."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.conversion import convert
from porotwin_cli.terminal import Json


def command(
    bag: Annotated[Path, typer.Argument(help='MCAP file or bag folder.')],
    folder: Annotated[Path, typer.Argument(help='Experiment folder to write.')],
    as_json: Json = False,
) -> None:
    """Convert an MCAP bag into an experiment folder.

    Example: ./porotwin export bags/sample sample_experiment
    """
    from porotwin_recording.bag_conversion import export_bag

    convert(export_bag, bag, folder, as_json=as_json)
