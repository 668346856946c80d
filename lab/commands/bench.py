"""./porotwin bench: speed and accuracy on this machine; each part has options of its own."""

import importlib
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from lab.benches.kept_table import keep_table, last_duration, make_folder
from porotwin_cli.options.crew_options import Scheduler, Workers
from porotwin_cli.options.seed_option import seed_option
from porotwin_cli.terminal import Json, print_json, print_table, say
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import HOUR_S, LONGEST_EXPERIMENT_S

BENCHES = {
    'solver': 'lab.benches.bench_solver',
    'imaging': 'lab.benches.bench_imaging',
    'costa': 'lab.benches.bench_costa',
    'cycle': 'lab.benches.bench_cycle',
    'diagnosis': 'lab.benches.bench_diagnosis',
}
"""Parts that are measured without a name, and the module whose `run()` returns a list of rows."""

LONG = {
    'loop': 'lab.loop.bench_loop',
    'mend': 'lab.loop.bench_mend',
    'fronts': 'lab.benches.bench_fronts',
    'physics': 'lab.benches.bench_physics',
    'faults': 'lab.faults.bench_faults',
    'fuzz': 'lab.faults.bench_fuzz',
    'calibration': 'lab.benches.bench_calibration',
    'scaling': 'lab.scaling.bench_scaling',
    'decision': 'lab.benches.bench_decision',
    'verification': 'lab.benches.bench_verification',
}
"""Parts that take long or need data: measured only by name."""

PLAIN = {
    'solver': 'Time and errors of the solver beside FiPy, MODFLOW 6 and PorePy.',
    'imaging': 'Time and memory from a photograph of 36 megapixels to a map, beside DarSIA.',
    'costa': 'Errors with and without COSTA, and the time that COSTA takes.',
    'cycle': 'Time of one cycle of the hub.',
    'diagnosis': 'Verdicts and time beside sparse regression.',
    'fronts': 'Designs for sharp fronts, side by side (docs/fronts.md).',
    'scaling': 'Many processes: measured with two, simulated with more.',
    'verification': 'Problems of the field, beside their solutions (docs/verification.md).',
}
"""Parts without options, and their help."""

Output = Annotated[
    Path | None, typer.Option(help='Folder of its runs; one with earlier runs is continued.')
]
Seed = Annotated[int, seed_option('Random seed.')]


class _Parts(TyperGroup):
    """The parts; an unknown name is one line."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Let --json stand before the part as well as after it."""
        if args[:1] == ['--json']:
            args = [*args[1:], *args[:1]]
        return super().parse_args(ctx, args)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the part that `args` begin with.

        Raises:
            InputError: there is none of this name.
        """
        if args[0] not in self.commands:
            known = ', '.join(self.commands)
            raise InputError(f"nothing to measure is called '{args[0]}'; choose {known}")
        return super().resolve_command(ctx, args)


command = typer.Typer(cls=_Parts, invoke_without_command=True)


@command.callback()
def bench(context: typer.Context, as_json: Json = False) -> None:
    """Measure speed and accuracy on this machine.

    Without a part: all that are quick, solver to diagnosis. Some figures are ratios to a baseline
    method, which runs on the same data. Tables are kept in runs/bench, and a row that became slower
    is named. loop, mend, physics, faults and fuzz take an hour or more.

    Example: ./porotwin bench solver

    Example: ./porotwin bench loop --scenarios 3 --output runs/bench
    """
    if context.invoked_subcommand is None:
        results = {part: _figures(part, as_json=as_json) for part in BENCHES}
        if as_json:
            print_json(results)


def _measure(part: str, *, as_json: bool, **options: Any) -> None:
    """Measure one part and print its figures."""
    figures = _figures(part, as_json=as_json, **options)
    if as_json:
        print_json(dict(figures) if isinstance(figures, Mapping) else {part: figures})


def _figures(part: str, *, as_json: bool, **options: Any) -> Any:
    """Return the figures of a part; print them as a table unless they shall be JSON."""
    before = last_duration(part)
    say(f'measuring {part} ...' + (f' the last time took {before:.0f} s' if before else ''))
    module = importlib.import_module({**BENCHES, **LONG}[part])
    make_folder()
    begin = time.monotonic()
    figures = module.run(**options)
    seconds = time.monotonic() - begin
    if not as_json:
        getattr(module, 'show', partial(_show, part))(figures)
    if isinstance(figures, list):
        _keep(part, figures, seconds)
    return figures


def _keep(part: str, rows: Sequence[Mapping[str, Any]], seconds: float) -> None:
    """Keep a table, and tell what became slower, or why it is not kept: the figures are printed."""
    try:
        for line in keep_table(part, rows, seconds):
            say(line)
    except InputError as error:
        say(f'the table is not kept: {error}')


def _show(part: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Print rows as a table with the name of `part`."""
    if rows:
        print_table(part, list(rows[0]), [list(row.values()) for row in rows])


def _plain(part: str, words: str) -> None:
    """Add a part without options."""

    def measure(as_json: Json = False) -> None:
        _measure(part, as_json=as_json)

    command.command(part, help=f'{words}\n\nExample: ./porotwin bench {part}')(measure)


for _part, _words in PLAIN.items():
    _plain(_part, _words)


@command.command()
def loop(
    scenarios: Annotated[int, typer.Option(help='Number of scenarios.', min=1)] = 20,
    maps: Annotated[
        bool,
        typer.Option('--maps', help='Noisy maps on coarse grids instead of photographs; faster.'),
    ] = False,
    seed: Seed = 1,
    workers: Workers = None,
    scheduler: Scheduler = '',
    output: Output = None,
    as_json: Json = False,
) -> None:
    """Scenarios with a zone to protect, under several controllers.

    Example: ./porotwin bench loop --scenarios 3 --output runs/bench
    """
    _measure(
        'loop',
        as_json=as_json,
        scenarios=scenarios,
        photographs=not maps,
        seed=seed,
        workers=workers,
        scheduler=scheduler,
        output=output,
    )


@command.command()
def mend(
    scenarios: Annotated[int, typer.Option(help='Number of hidden effects.', min=1)] = 20,
    seed: Seed = 1,
    workers: Workers = None,
    scheduler: Scheduler = '',
    output: Output = None,
    as_json: Json = False,
) -> None:
    """Twins that find a hidden effect, beside twins that knew it or never find out.

    Example: ./porotwin bench mend --scenarios 20 --output runs/bench-mend
    """
    _measure(
        'mend',
        as_json=as_json,
        scenarios=scenarios,
        seed=seed,
        workers=workers,
        scheduler=scheduler,
        output=output,
    )


@command.command()
def physics(
    scenarios: Annotated[int, typer.Option(help='Draws of each effect.', min=1)] = 1,
    seed: Seed = 1,
    workers: Workers = None,
    scheduler: Scheduler = '',
    output: Output = None,
    as_json: Json = False,
) -> None:
    """What COSTA learns of physics that the model lacks.

    Example: ./porotwin bench physics --output runs/physics
    """
    _measure(
        'physics',
        as_json=as_json,
        scenarios=scenarios,
        seed=seed,
        workers=workers,
        scheduler=scheduler,
        output=output,
    )


@command.command()
def faults(
    kills: Annotated[int, typer.Option(help='Kills of each node.', min=0)] = 100,
    hours: Annotated[
        float,
        typer.Option(
            help='Simulated time of the memory test [h].', min=0, max=LONGEST_EXPERIMENT_S / HOUR_S
        ),
    ] = 24.0,
    seed: Seed = 1,
    as_json: Json = False,
) -> None:
    """Memory over a day, and kills at random moments.

    Example: ./porotwin bench faults --kills 2 --hours 0.5
    """
    _measure('faults', as_json=as_json, kills=kills, hours=hours, seed=seed)


@command.command()
def decision(
    photographs: Annotated[int, typer.Option(help='Photographs that are timed.', min=1)] = 10,
    programs: Annotated[
        int, typer.Option(help='Idle programs of others that join the domain.', min=0)
    ] = 0,
    as_json: Json = False,
) -> None:
    """Time from a photograph to its setpoint, with all nodes.

    Example: ./porotwin bench decision --programs 10
    """
    _measure('decision', as_json=as_json, photographs=photographs, programs=programs)


@command.command()
def fuzz(
    minutes: Annotated[float, typer.Option(help='Time of the whole run [min].', min=0.1)] = 60.0,
    seed: Seed = 1,
    as_json: Json = False,
) -> None:
    """Damaged files for all readers, and random words for a running graph and its page.

    Example: ./porotwin bench fuzz --minutes 10 --seed 2
    """
    _measure('fuzz', as_json=as_json, minutes=minutes, seed=seed)


@command.command()
def calibration(
    baseline: Annotated[
        Path | None,
        typer.Option(help='Experiment folder with a real photograph and its sands; needed.'),
    ] = None,
    cases: Annotated[int, typer.Option(help='Composed cases.', min=1)] = 20,
    seed: Seed = 1,
    workers: Workers = None,
    scheduler: Scheduler = '',
    output: Output = None,
    as_json: Json = False,
) -> None:
    """Calibrations of composed photographs: their maps and their refusals.

    Example: ./porotwin bench calibration --baseline experiment --cases 20
    """
    _measure(
        'calibration',
        as_json=as_json,
        baseline=baseline,
        cases=cases,
        seed=seed,
        workers=workers,
        scheduler=scheduler,
        output=output,
    )
