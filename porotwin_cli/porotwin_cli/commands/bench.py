"""./porotwin bench: speed and accuracy on this machine."""

import importlib
from typing import Annotated, Any

import typer

from porotwin_cli.terminal import Json, print_json, print_table, say
from porotwin_core.errors import InputError

BENCHES = {
    'solver': 'porotwin_solver.solver_bench',
    'imaging': 'porotwin_imaging.imaging_bench',
    'costa': 'porotwin_cli.bench_costa',
    'loop': 'porotwin_cli.bench_loop',
    'diagnosis': 'porotwin_validation.diagnosis_bench',
}
"""Parts that can be measured, and the module whose `run()` returns a list of rows."""


def command(
    parts: Annotated[
        list[str] | None,
        typer.Argument(help=f'Parts to measure: {", ".join(BENCHES)}. Default: all.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure speed and accuracy on this machine.

    Some figures are ratios to a baseline, which runs on the same data beside the measured part.

    Example: ./porotwin bench solver
    """
    results: dict[str, Any] = {}
    for part in parts or list(BENCHES):
        if part not in BENCHES:
            raise InputError(f"nothing to measure is called '{part}'; choose {', '.join(BENCHES)}")
        say(f'measuring {part} ...')
        rows = importlib.import_module(BENCHES[part]).run()
        results[part] = rows
        if not as_json:
            print_table(part, list(rows[0]), [list(row.values()) for row in rows])
    if as_json:
        print_json(results)
