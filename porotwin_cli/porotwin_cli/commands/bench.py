"""./porotwin bench: speed and accuracy on this machine."""

import importlib
from pathlib import Path
from typing import Annotated, Any

import typer

from porotwin_cli.crew_options import Scheduler, Workers
from porotwin_cli.seed_option import seed_option
from porotwin_cli.terminal import Json, print_json, print_table, say
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import HOUR_S, LONGEST_EXPERIMENT_S

BENCHES = {
    'solver': 'porotwin_solver.solver_bench',
    'imaging': 'porotwin_imaging.imaging_bench',
    'costa': 'porotwin_cli.bench_costa',
    'cycle': 'porotwin_cli.bench_cycle',
    'diagnosis': 'porotwin_validation.diagnosis_bench',
}
"""Parts that can be measured, and the module whose `run()` returns a list of rows."""

LONG = {
    'loop': 'porotwin_cli.bench_loop',
    'mend': 'porotwin_cli.bench_mend',
    'physics': 'porotwin_cli.bench_physics',
    'faults': 'porotwin_cli.bench_faults',
    'calibration': 'porotwin_cli.bench_calibration',
    'scaling': 'porotwin_cli.bench_scaling',
    'decision': 'porotwin_cli.bench_decision',
}
"""Parts that take long or need data: measured only by name."""

SCENARIOS = 20
"""Usual number of scenarios of `loop` and `mend`."""

OWN_TABLES = ('loop', 'mend', 'physics')
"""Parts whose module prints its table."""


def command(
    parts: Annotated[
        list[str] | None,
        typer.Argument(
            help=f'Parts to measure: {", ".join(BENCHES)} (default: all of these); only by name: '
            f'{", ".join(LONG)}. loop, mend, physics and faults take an hour or more; calibration '
            'needs --baseline.'
        ),
    ] = None,
    kills: Annotated[int, typer.Option(help='faults: kills of each node.', min=0)] = 100,
    hours: Annotated[
        float,
        typer.Option(
            help='faults: simulated time of the memory test [h].',
            min=0,
            max=LONGEST_EXPERIMENT_S / HOUR_S,
        ),
    ] = 24.0,
    tries: Annotated[
        int, typer.Option(help='faults: damaged files for each reader.', min=0)
    ] = 1000,
    seed: Annotated[
        int,
        seed_option('loop, mend, physics, faults, calibration: random seed.'),
    ] = 1,
    baseline: Annotated[
        Path | None,
        typer.Option(help='calibration: experiment folder with a real photograph and its sands.'),
    ] = None,
    cases: Annotated[int, typer.Option(help='calibration: composed cases.', min=1)] = 20,
    scenarios: Annotated[
        int,
        typer.Option(
            help='loop, mend: number of scenarios, usually 20; physics: draws of each effect, '
            'usually 1.',
            min=0,
        ),
    ] = 0,
    maps: Annotated[
        bool,
        typer.Option(
            '--maps',
            help='loop: noisy maps on coarse grids instead of photographs; faster.',
        ),
    ] = False,
    workers: Workers = None,
    scheduler: Scheduler = '',
    output: Annotated[
        Path | None,
        typer.Option(
            help='loop, mend, physics, calibration: folder of its runs; one with earlier runs is '
            'continued.'
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure speed and accuracy on this machine.

    Some figures are ratios to a baseline method, which runs on the same data.

    Example: ./porotwin bench solver

    Example: ./porotwin bench loop --scenarios 3 --output runs/bench

    Example: ./porotwin bench physics --output runs/physics

    Example: ./porotwin bench faults --kills 2 --hours 0.5 --tries 50

    Example: ./porotwin bench calibration --baseline experiment --cases 20

    Example: ./porotwin bench scaling

    Example: ./porotwin bench decision
    """
    modules = {**BENCHES, **LONG}
    for part in parts or ():  # before the first one, which may take an hour
        if part not in modules:
            raise InputError(f"nothing to measure is called '{part}'; choose {', '.join(modules)}")
    many = {'workers': workers, 'scheduler': scheduler}
    options: dict[str, dict[str, Any]] = {
        'faults': {'kills': kills, 'hours': hours, 'tries': tries, 'seed': seed},
        'mend': {'scenarios': scenarios or SCENARIOS, 'seed': seed, 'output': output, **many},
        'calibration': {
            'baseline': baseline, 'cases': cases, 'seed': seed, 'output': output, **many,
        },
        'loop': {
            'scenarios': scenarios or SCENARIOS, 'seed': seed, 'output': output,
            'photographs': not maps, **many,
        },
        'physics': {'scenarios': scenarios or 1, 'seed': seed, 'output': output, **many},
    }  # fmt: skip
    results: dict[str, Any] = {}
    for part in parts or list(BENCHES):
        say(f'measuring {part} ...')
        module = importlib.import_module(modules[part])
        found = module.run(**options.get(part, {}))
        results |= found if part == 'loop' else {part: found}
        if as_json:
            continue
        if part in OWN_TABLES:
            module.show(found)
        elif found:
            print_table(part, list(found[0]), [list(row.values()) for row in found])
    if as_json:
        print_json(results)
