"""The process of a peer: `python -m lab.benches.peers.child MODULE FOLDER`.

It needs NumPy and the peer, since its Python may be another one than ours. `prepare(problem)` of
the module returns the work that is timed; preparation and imports are not.
"""

import importlib
import os
import resource
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

Problem = Mapping[str, Any]
"""Arrays that describe a problem for a peer, by name."""

PROBLEM, RESULT = 'problem.npz', 'result.npz'
"""Files in the folder."""


def main(module: str, folder: Path) -> None:
    """Solve the problem in `folder`, and write the maps with their cost."""
    peer = importlib.import_module(module)
    with np.load(folder / PROBLEM) as file:
        work = peer.prepare(dict(file))
    begin, clock = _processor_s(), time.perf_counter()
    maps = work()
    np.savez(
        folder / RESULT,
        maps=maps,
        processor_s=_processor_s() - begin,
        wall_s=time.perf_counter() - clock,
        memory_gb=max(most_memory_kb(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
        / 1e6,
        version=peer.version(),
    )


def most_memory_kb() -> float:
    """Return the most memory of this process [kB]; `ru_maxrss` starts from its parent's."""
    lines = Path('/proc/self/status').read_text(encoding='ascii').splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith('VmHWM'))


def _processor_s() -> float:
    """Return the processor time of this process and of the programs that it called [s]."""
    return sum(os.times()[:4])


if __name__ == '__main__':
    try:
        main(sys.argv[1], Path(sys.argv[2]))
    except Exception as error:
        sys.exit(f'{type(error).__name__}: {error}')
