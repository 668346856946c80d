"""The long fault suite: memory over a day, and kills at random moments.

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
from porotwin_cli.terminal import say
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S

KILLS = 100
HOURS = 24.0
SEED = 1
"""Defaults: kills of each node, simulated time [h], and the seed."""

SECONDS_PER_KILL = 20.0
SECONDS_PER_PHOTOGRAPH = 0.8
"""Rough times on two cores [s], for the estimate at the start."""

NODES = 9
"""Nodes of the twin in this benchmark, about."""


def estimate_s(kills: int, hours: float) -> float:
    """Return about how long the benchmark takes [s]."""
    photographs = hours * HOUR_S / USUAL_PHOTO_INTERVAL_S
    return SECONDS_PER_PHOTOGRAPH * photographs + SECONDS_PER_KILL * kills * NODES


def run(*, kills: int = KILLS, hours: float = HOURS, seed: int = SEED) -> list[dict[str, Any]]:
    """Return a row for each node; 'faults' counts all that should not be.

    Args:
        kills: kills of each node.
        hours: simulated time with the memory written down [h].
        seed: seed of the moments.

    Raises:
        WorkFailed: the twin does not start, or stalls.
    """
    if hours <= 0.0:
        return []
    say(f'this takes about {estimate_s(kills, hours) / 60.0:.0f} min')
    # the experiment goes on while nodes are killed
    reserve = kills * NODES * SECONDS_PER_KILL * 2.0 * USUAL_PHOTO_INTERVAL_S / HOUR_S
    with long_run(hours + reserve + 1.0, seed) as twin:
        memory = {node: growth(values) for node, values in read_memory(twin, hours).items()}
        killed = kill_nodes(twin, kills, seed)
    rows = []
    for node, found in memory.items():
        outcome = killed.get(node, Kills())
        grows = found.late_share > MOST_GROWTH
        rows.append(
            {
                'part': node,
                'tries': outcome.count,
                'outcome': (
                    f'{found.warm / MEGABYTE:.1f} to {found.end / MEGABYTE:.1f} MB '
                    f'({100.0 * found.share:+.1f} %, in the second half '
                    f'{100.0 * found.late_share:+.1f} %); {_recovery(outcome)}'
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
