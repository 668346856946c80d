"""Memory that is too small: compiled libraries end without a word where it is full.

This module imports the standard library only, so that it is there first.
"""

import resource
import sys
from contextlib import suppress
from pathlib import Path

LEAST_BYTES = 1_500_000_000
"""Memory below which commands crash [B]: `check` needs 1.2 GB of addresses."""

CONTAINER = Path('/sys/fs/cgroup/memory.max')
"""File with the limit of a container."""


def refuse_small_memory(container: Path = CONTAINER) -> None:
    """End the process with one line if the shell or the container allows too little memory.

    Raises:
        SystemExit: with status 1.
    """
    limits = {}
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    if allowed != resource.RLIM_INFINITY:
        limits['the shell'] = allowed, 'set ulimit -v unlimited'
    with suppress(OSError, ValueError):  # no container, or one without a limit
        limits['the container'] = int(container.read_text(encoding='ascii')), 'allow it more'
    for owner, (limit, remedy) in limits.items():
        if limit < LEAST_BYTES:
            print(
                f'porotwin: {owner} allows {limit / 1e6:.0f} MB of memory, less than the '
                f'{LEAST_BYTES / 1e6:.0f} MB that commands need; {remedy}',
                file=sys.stderr,
            )
            sys.exit(1)
