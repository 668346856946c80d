"""./porotwin bench: speed and accuracy on this machine."""

import importlib
from pathlib import Path
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

LONG = {
    'faults': 'porotwin_cli.bench_faults',
    'calibration': 'porotwin_validation.calibration_bench',
}
"""Parts that take hours or need data: measured only by name."""


def command(
    parts: Annotated[
        list[str] | None,
        typer.Argument(
            help=f'Parts to measure: {", ".join(BENCHES)}; only by name: faults (takes hours), '
            'calibration (needs --baseline). Default: all but these two.'
        ),
    ] = None,
    kills: Annotated[int, typer.Option(help='faults: how often each node is killed.', min=0)] = 100,
    hours: Annotated[
        float, typer.Option(help='faults: simulated time with the memory written down [h].', min=0)
    ] = 24.0,
    tries: Annotated[
        int, typer.Option(help='faults: damaged files for each reader.', min=0)
    ] = 1000,
    seed: Annotated[
        int, typer.Option(help='faults: seed of moments and damages; calibration: of cases.')
    ] = 1,
    baseline: Annotated[
        Path | None,
        typer.Option(help='calibration: experiment folder with a real baseline and its sands.'),
    ] = None,
    cases: Annotated[int, typer.Option(help='calibration: composed cases.', min=1)] = 20,
    as_json: Json = False,
) -> None:
    """Measure speed and accuracy on this machine.

    Some figures are ratios to a baseline, which runs on the same data beside the measured part.

    Example: ./porotwin bench solver

    Example: ./porotwin bench faults --kills 2 --hours 0.5 --tries 50

    Example: ./porotwin bench calibration --baseline experiment --cases 20
    """
    modules = {**BENCHES, **LONG}
    options: dict[str, dict[str, Any]] = {
        'faults': {'kills': kills, 'hours': hours, 'tries': tries, 'seed': seed},
        'calibration': {'baseline': baseline, 'cases': cases, 'seed': seed},
    }
    results: dict[str, Any] = {}
    for part in parts or list(BENCHES):
        if part not in modules:
            raise InputError(f"nothing to measure is called '{part}'; choose {', '.join(modules)}")
        say(f'measuring {part} ...')
        rows = importlib.import_module(modules[part]).run(**options.get(part, {}))
        results[part] = rows
        if rows and not as_json:
            print_table(part, list(rows[0]), [list(row.values()) for row in rows])
    if as_json:
        print_json(results)
