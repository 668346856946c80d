"""The long fault suite: memory over a day, kills at random moments, damaged files for all readers.

The short one is part of ./porotwin test; docs/faults.md lists its faults.
"""

from typing import Any

import numpy as np

from lab.faults.endurance import (
    HOUR_S,
    MEGABYTE,
    MOST_GROWTH,
    Kills,
    growth,
    kill_nodes,
    long_run,
    read_memory,
)
from lab.faults.fuzzing import READERS, fuzz
from porotwin_cli.terminal import progress, say
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S

KILLS = 100
HOURS = 24.0
TRIES = 1000
SEED = 1
"""Defaults: kills of each node, simulated time [h], damaged files per reader, and the seed."""

SECONDS_PER_KILL = 20.0
SECONDS_PER_PHOTOGRAPH = 0.8
SECONDS_PER_TRY = 0.05
"""Rough times on two cores [s], for the estimate at the start."""

NODES = 9
"""Nodes of the twin in this benchmark, about."""


def estimate_s(kills: int, hours: float, tries: int) -> float:
    """Return about how long the benchmark takes [s]."""
    photographs = hours * HOUR_S / USUAL_PHOTO_INTERVAL_S
    return (
        SECONDS_PER_PHOTOGRAPH * photographs
        + SECONDS_PER_KILL * kills * NODES
        + SECONDS_PER_TRY * tries * len(READERS)
    )


def run(
    *, kills: int = KILLS, hours: float = HOURS, tries: int = TRIES, seed: int = SEED
) -> list[dict[str, Any]]:
    """Return a row for each node and reader; 'faults' counts all that should not be.

    Args:
        kills: kills of each node.
        hours: simulated time with the memory written down [h].
        tries: damaged files for each reader.
        seed: seed of the moments and the damages.

    Raises:
        WorkFailed: the twin does not start, or stalls.
    """
    say(f'this takes about {estimate_s(kills, hours, tries) / 60.0:.0f} min')
    return [*_node_rows(kills, hours, seed), *_reader_rows(tries, seed)]


def _node_rows(kills: int, hours: float, seed: int) -> list[dict[str, Any]]:
    if hours <= 0.0:
        return []
    # the experiment goes on while nodes are killed
    reserve = kills * NODES * SECONDS_PER_KILL * 2.0 * USUAL_PHOTO_INTERVAL_S / HOUR_S
    with long_run(hours + reserve + 1.0, seed) as twin:
        memory = {node: growth(values) for node, values in read_memory(twin, hours).items()}
        killed = kill_nodes(twin, kills, seed)
    rows = []
    for node, found in memory.items():
        outcome = killed.get(node, Kills())
        grows = found.share > MOST_GROWTH
        rows.append(
            {
                'part': node,
                'tries': outcome.count,
                'outcome': (
                    f'{found.warm / MEGABYTE:.1f} to {found.end / MEGABYTE:.1f} MB '
                    f'({100.0 * found.share:+.1f} %, {found.per_1000 / MEGABYTE:+.1f} MB per 1000 '
                    f'photographs); {_recovery(outcome)}'
                ),
                'faults': outcome.failures + int(grows),
                'first fault': 'its memory grows' if grows else '',
            }
        )
    return rows


def _recovery(kills: Kills) -> str:
    if not kills.recoveries:
        return 'not killed' if not kills.count else 'never back'
    median, longest = np.median(kills.recoveries), max(kills.recoveries)
    return f'back after {median:.0f} s (median), {longest:.0f} s (longest)'


def _reader_rows(tries: int, seed: int) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    if tries == 0:
        return rows
    with progress() as bar:
        for name in bar.track(list(READERS), description='damaged files'):
            found = fuzz(name, tries=tries, seed=seed)
            rows.append(
                {
                    'part': name,
                    'tries': tries,
                    'outcome': f'{found.read} read, {found.refused} refused with one line',
                    'faults': len(found.faults),
                    'first fault': found.faults[0] if found.faults else '',
                }
            )
    return rows
