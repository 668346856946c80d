"""./porotwin import: an experiment folder into a bag."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.conversion import convert
from porotwin_cli.terminal import Json


def command(
    folder: Annotated[Path, typer.Argument(help='Experiment folder.')],
    bag: Annotated[Path, typer.Argument(help='Bag folder to write.')],
    as_json: Json = False,
) -> None:
    """Convert an experiment folder into an MCAP bag.

    Example: ./porotwin import experiment experiment_bag
    """
    from porotwin_recording.bag_conversion import import_experiment

    convert(import_experiment, folder, bag, as_json=as_json)
