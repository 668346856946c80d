"""Random words and damaged files: each must be taken or refused, and nothing may break.

Half of the time goes to damaged files for every reader, half to a running graph and its page.
"""

import time
from collections.abc import Iterator
from typing import Any

from lab.faults.fuzzing import BATCH, READERS, FuzzResult, fuzz
from lab.faults.graph_fuzzing import fuzz_graph
from porotwin_cli.terminal import progress
from porotwin_core.basis.units import MINUTE_S

MINUTES = 60.0
"""Default time of the whole run [min]."""


def run(*, minutes: float = MINUTES, seed: int = 1) -> list[dict[str, Any]]:
    """Return a row for each reader and one for the graph; 'faults' counts all that should not be.

    Args:
        minutes: wall time [min].
        seed: seed of the damages and the words.

    Raises:
        WorkFailed: the twin does not start.
    """
    with progress() as bar:
        task = bar.add_task('running graph', total=1.0)
        graph = fuzz_graph(minutes / 2.0, seed, lambda share: bar.update(task, completed=share))
        rows = list(_reader_rows(minutes / 2.0, seed, bar))
    taken = f'{graph.read} messages, requests and parameters'
    return [*rows, {'part': 'running graph', 'outcome': taken, **_faults(graph)}]


def _reader_rows(minutes: float, seed: int, bar: Any) -> Iterator[dict[str, Any]]:
    """Damage the files of one reader after the other for the same time; yield a row for each."""
    for name in bar.track(list(READERS), description='damaged files'):
        found = FuzzResult()
        begun, first = time.monotonic(), seed
        while time.monotonic() - begun < MINUTE_S * minutes / len(READERS):
            found.add(fuzz(READERS[name], tries=BATCH, seed=first))
            first += BATCH
        outcome = f'{found.read} read, {found.refused} refused with one line'
        yield {'part': name, 'outcome': outcome, **_faults(found)}


def _faults(found: FuzzResult) -> dict[str, Any]:
    return {'faults': len(found.faults), 'the first ones': '\n'.join(found.faults[:3])}
