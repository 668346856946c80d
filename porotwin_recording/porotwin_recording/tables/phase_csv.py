"""Maps of phases as text, in the form of the International FluidFlower benchmark.

A file holds one map: a row of the rig in each line, the upper row first, with 0 for water, 1 for
dissolved CO2 and 2 for gas. Lines of words begin with #. Its name ends in the time, such as
segmentation_010800s.csv.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import read_regular

_TIME = re.compile(r'(\d+)s\.csv$')
"""End of the name of a file: the time [s]."""


def read_phase_csv(path: Path, phases: int) -> NDArray[np.uint8]:
    """Return the map of a file, shape (nz, nx), row 0 at the bottom.

    Args:
        path: the file.
        phases: how many phases there are; numbers in the file are smaller.

    Raises:
        InputError: the file cannot be read, or is no such map.
    """
    form = f'give rows of the numbers 0 to {phases - 1} with commas between them'
    try:
        lines = read_regular(path).decode().splitlines()
        rows = [line.rstrip(',').split(',') for line in lines if line and line[0] != '#']
        numbers = np.array([[float(word) for word in row] for row in rows])
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise InputError(f'{path}: no map of phases ({error}); {form}') from None
    if numbers.ndim != 2 or not np.isin(numbers, range(phases)).all():
        raise InputError(f'{path}: no map of phases; {form}')
    return numbers[::-1].astype(np.uint8)


def read_phase_series(folder: Path, phases: int) -> dict[float, NDArray[np.uint8]]:
    """Return the maps of a folder by time [s], in order.

    Raises:
        InputError: there is none, or one cannot be read.
    """
    found = {float(m[1]): path for path in folder.glob('*.csv') if (m := _TIME.search(path.name))}
    if not found:
        raise InputError(
            f'{folder}: no maps of phases; their names end in the time, as map_010800s.csv'
        )
    return {time: read_phase_csv(found[time], phases) for time in sorted(found)}
