"""./porotwin check: odd values of a rig or a recording, and the cost of a prediction."""

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from porotwin_cli.options.output_files import check_output
from porotwin_cli.terminal import Json, print_json, say
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import DAY_S
from porotwin_core.model.preset_names import PRESET_WORDS

PICTURE = 'check.png'
"""Name of the picture by default."""


def command(
    path: Annotated[Path, typer.Argument(help='rig.yaml, experiment folder or MCAP bag.')],
    output: Annotated[Path, typer.Option(help='Picture to draw, PNG.')] = Path(PICTURE),
    grid: Annotated[
        str, typer.Option(help='Columns x rows, such as 187x112. Default: cells of 5 mm.')
    ] = '',
    preset: Annotated[str, typer.Option(help=f'Preset: {PRESET_WORDS}.')] = 'fast',
    photo_interval_s: Annotated[
        float | None,
        typer.Option(
            help='Time between photographs, for the cost [s]; default: as recorded, or 30 s.',
            min=0.1,
            max=DAY_S,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Check a rig or a recording before work begins.

    The command lists odd and impossible values with reason and remedy, estimates the cost of a
    prediction, and draws a picture. Exit status 0: the rig can be used; 2: it cannot.

    Example: ./porotwin check rig.yaml --output check.png
    """
    from porotwin_cli.checking.rig_check import balance_of, check, in_words
    from porotwin_cli.pictures.check_picture import check_picture

    named = output != Path(PICTURE) and not output.is_dir()
    if output.is_dir():
        output = output / PICTURE
    if output.suffix.lower() != '.png':
        raise InputError(f'{output}: the picture is a PNG; give a name that ends in .png')
    check_output(output, path, command='check', named=named)  # an earlier picture is replaced
    checked = check(path, grid=grid, preset=preset, interval=photo_interval_s)
    words, balance = in_words(checked), balance_of(checked)
    check_picture(output, checked, words)
    if as_json:
        print_json(
            {
                'path': path,
                'kind': checked.kind,
                'rig': checked.rig.name,
                'runs': checked.runs,
                'remarks': [dataclasses.asdict(remark) for remark in checked.remarks],
                'grid': str(checked.grid),
                'preset': preset,
                'photo_interval_s': checked.interval.seconds,
                'water_ml_h': None if balance is None else balance.in_ml_h,
                'cost': None if checked.cost is None else dataclasses.asdict(checked.cost),
                'picture': output,
            }
        )
    else:
        for remark in checked.remarks:
            print(f'{"impossible" if remark.refused else "odd"}: {remark}')
        for line in words:
            print(line)
        print(f'{_verdict(checked.runs, len(checked.remarks))}; picture: {output}')
    if not checked.runs:
        say(f'porotwin: {path}: cannot be run; correct the impossible values')
        raise typer.Exit(2)


def _verdict(runs: bool, count: int) -> str:
    if not runs:
        return 'this cannot be run'
    return 'this can be run, but look at the odd values' if count else 'nothing odd'
