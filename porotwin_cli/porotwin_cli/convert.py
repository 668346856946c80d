"""./porotwin import and export: experiment folder to bag and back."""

from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.output import Json, print_json, progress, refuse_existing


def import_command(
    folder: Annotated[Path, typer.Argument(help='Experiment folder.')],
    bag: Annotated[Path, typer.Argument(help='Bag folder to write.')],
    as_json: Json = False,
) -> None:
    """Turn an experiment folder into an MCAP bag.

    Example: ./porotwin import experiment experiment_bag
    """
    from porotwin_recording.bag_conversion import import_experiment

    refuse_existing(bag)
    with progress() as bar:
        task = bar.add_task('importing', total=None)
        import_experiment(
            folder, bag, progress=lambda n, of: bar.update(task, completed=n, total=of)
        )
    _report(bag, as_json)


def export_command(
    bag: Annotated[Path, typer.Argument(help='MCAP file or bag folder.')],
    folder: Annotated[Path, typer.Argument(help='Experiment folder to write.')],
    as_json: Json = False,
) -> None:
    """Turn an MCAP bag into an experiment folder.

    Example: ./porotwin export bags/sample sample_experiment
    """
    from porotwin_recording.bag_conversion import export_bag

    refuse_existing(folder)
    with progress() as bar:
        task = bar.add_task('exporting', total=None)
        export_bag(bag, folder, progress=lambda n, of: bar.update(task, completed=n, total=of))
    _report(folder, as_json)


def _report(output: Path, as_json: bool) -> None:
    from porotwin_recording.recording import open_recording

    made = open_recording(output)
    maps, photographs = len(made.maps) if made.maps is not None else 0, len(made.photos)
    if as_json:
        print_json({'output': output, 'maps': maps, 'photographs': photographs})
    else:
        print(f'{output}: {maps} maps, {photographs} photographs')
