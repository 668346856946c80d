"""Errors of the model in problems that the field knows (docs/verification.md)."""

import time
from collections.abc import Container
from typing import Any

from lab.verification.problems import PROBLEMS


def run(names: Container[str] = ()) -> list[dict[str, Any]]:
    """Return a row for each error of each problem, and one for the time of the problem [s].

    `names`: of the problems; empty: all.
    """
    rows = []
    for problem in PROBLEMS:
        if names and problem.name not in names:
            continue
        begin = time.perf_counter()
        figures = problem.errors()
        figures['time [s]'] = time.perf_counter() - begin
        rows += [
            {'problem': problem.name, 'figure': name, 'value': f'{value:.2g}'}
            for name, value in figures.items()
        ]
    return rows
