"""./porotwin import and export: experiment folder to bag and back."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.output import Json, print_json, refuse_existing, say


def import_command(
    folder: Annotated[Path, typer.Argument(help='Experiment folder.')],
    bag: Annotated[Path, typer.Argument(help='Bag folder to write.')],
    as_json: Json = False,
) -> None:
    """Turn an experiment folder into an MCAP bag.

    Example: ./porotwin import experiment experiment_bag
    """
    from porotwin_recording.convert import import_experiment

    refuse_existing(bag)
    _report(import_experiment(folder, bag), bag, as_json)


def export_command(
    bag: Annotated[Path, typer.Argument(help='MCAP file or bag folder.')],
    folder: Annotated[Path, typer.Argument(help='Experiment folder to write.')],
    as_json: Json = False,
) -> None:
    """Turn an MCAP bag into an experiment folder.

    Example: ./porotwin export bags/sample sample_experiment
    """
    from porotwin_recording.convert import export_bag

    refuse_existing(folder)
    _report(export_bag(bag, folder), folder, as_json)


def _report(counts: dict[str, int], output: Path, as_json: bool) -> None:
    if as_json:
        print_json({'output': output, **counts})
    else:
        say(f'{output}: ' + ', '.join(f'{count} {name}' for name, count in counts.items()))
