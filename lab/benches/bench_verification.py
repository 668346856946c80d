"""Errors of the model in problems that the field knows (docs/verification.md)."""

import time
from typing import Any

from lab.verification.problems import PROBLEMS


def run() -> list[dict[str, Any]]:
    """Return a row for each error of each problem, and one for the time of the problem [s]."""
    rows = []
    for problem in PROBLEMS:
        begin = time.perf_counter()
        figures = problem.errors()
        figures['time [s]'] = time.perf_counter() - begin
        rows += [
            {'problem': problem.name, 'figure': name, 'value': f'{value:.2g}'}
            for name, value in figures.items()
        ]
    return rows
