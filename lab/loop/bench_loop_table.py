"""The figures of all runs of the loop bench, side by side, and the goals they are held against."""

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from lab.loop.bench_loop_eyes import BenchSettings
from porotwin_cli.running.loop_run import LoopFigures
from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_cli.terminal import print_table

Runs = Mapping[str, Mapping[str, LoopFigures]]
"""Figures by scenario and run."""

COLUMNS = (
    'dose_ml_min', 'end_ml', 'water_ml', 'orders', 'violations', 'model_runs', 'decision_s',
    'decision_p99_s',
)  # fmt: skip
"""Figures in the table, in this order."""

LEAST_DOSE_ML_MIN = 2.0
"""Dose of the optimum below which a ratio says nothing [ml min]: the error of the maps."""

GOALS = (
    ('dose, twin / optimum', 1.15),
    ('dose, twin / paper', 0.35),
    ('orders, twin / paper', 1.0 / 3.0),
    ('dose, optimum / paper', math.nan),
)
"""Wanted ratios of medians, at most; NaN: nothing is wanted. The last one is a bound: no controller
gets below it in these scenarios."""


def summary(
    scenarios: Sequence[LoopScenario], figures: Runs, settings: BenchSettings
) -> dict[str, Any]:
    """Return the table for JSON.

    `scenarios` holds a record per scenario with every figure by run, and the same figures by run
    and figure. `medians` are those over all scenarios, `violations` is summed up. `ratios` are
    ratios of medians, and the medians of the ratios of all scenarios where they say something.
    """
    return {
        'maps': 'photographs' if settings.photographs else 'maps with noise, no photographs',
        'scenarios': [_record(scenario, figures[scenario.name]) for scenario in scenarios],
        'medians': _medians(figures),
        'ratios': _ratios(figures),
    }


def _record(scenario: LoopScenario, runs: Mapping[str, LoopFigures]) -> dict[str, Any]:
    by_run = {name: asdict(found) for name, found in runs.items()}
    by_figure = {
        column: {name: getattr(found, column) for name, found in runs.items()} for column in COLUMNS
    }
    return {'name': scenario.name, 'what': scenario.describes, **by_figure, **by_run}


def _medians(figures: Runs) -> dict[str, dict[str, float]]:
    names = list(next(iter(figures.values())))
    return {
        name: {
            column: _total(column, [getattr(runs[name], column) for runs in figures.values()])
            for column in COLUMNS
        }
        for name in names
    }


def _total(column: str, values: Sequence[float]) -> float:
    if column == 'violations':
        return sum(values)
    finite = [value for value in values if math.isfinite(value)]
    return statistics.median(finite) if finite else math.nan


def _ratios(figures: Runs) -> dict[str, dict[str, float]]:
    """Return every ratio of the goals by name: of the medians, and the median of the ratios."""
    medians, found = _medians(figures), {}
    for name, wanted in GOALS:
        what, _, pair = name.partition(', ')
        above, below = pair.split(' / ')
        if above not in medians or below not in medians:
            continue
        column = 'dose_ml_min' if what == 'dose' else what
        ratios = [
            getattr(runs[above], column) / getattr(runs[below], column)
            for runs in figures.values()
            if getattr(runs[below], column) >= (LEAST_DOSE_ML_MIN if what == 'dose' else 1.0)
        ]
        found[name] = {
            'wanted': wanted,
            'of_medians': _ratio(medians[above][column], medians[below][column]),
            'median_of_ratios': statistics.median(ratios) if ratios else math.nan,
            'scenarios': len(ratios),
        }
    return found


def _ratio(above: float, below: float) -> float:
    return above / below if below > 0.0 else math.nan


def show(table: Mapping[str, Any]) -> None:
    """Print the table: the doses of all scenarios, all medians, and the ratios."""
    names = list(table['medians'])
    print_table(
        f'dose where tracer must not be [ml min] ({table["maps"]})',
        ['scenario', *names, 'what'],
        [
            [row['name'], *(f'{row["dose_ml_min"][name]:.1f}' for name in names), row['what']]
            for row in table['scenarios']
        ],
    )
    print_table(
        'medians over the scenarios; violations: all together',
        ['', *COLUMNS],
        [
            [name, *(f'{table["medians"][name][column]:.3g}' for column in COLUMNS)]
            for name in names
        ],
    )
    print_table(
        'ratios',
        ['', 'wanted, at most', 'of the medians', 'median of the ratios', 'scenarios'],
        [
            [
                name,
                f'{row["wanted"]:.2f}',
                f'{row["of_medians"]:.2f}',
                f'{row["median_of_ratios"]:.2f}',
                row['scenarios'],
            ]
            for name, row in table['ratios'].items()
        ],
    )
