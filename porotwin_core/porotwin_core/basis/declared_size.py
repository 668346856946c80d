"""The size that a file may claim. Its reader asks here, and then makes room.

A few bytes can claim any size, in a header, a compressed part or a sparse table.
"""

import math
from collections.abc import Iterable

from porotwin_core.basis.errors import InputError

LARGEST_BYTES = 1 << 31
"""Most data that a reader holds at once [B]: 2000 maps of 750 x 300 cells, and four times the
largest photograph."""


def check_declared(
    label: object, sizes: Iterable[float], *, most: int = LARGEST_BYTES, unit: str = 'bytes'
) -> None:
    """Check the product of the `sizes` that a file claims.

    Args:
        label: the file or the part of it, which opens the message.
        sizes: of an array and of its elements, for example; they may be any numbers.
        most: the limit.
        unit: of the sizes, for the message.

    Raises:
        InputError: it claims more than `most`.
    """
    claimed = math.prod(max(0.0, float(size)) for size in sizes)
    if claimed > most:
        raise InputError(
            f'{label}: claims {claimed:.4g} {unit}, more than {most:.4g}, the most that is read at '
            'once; write it again, or a part of it'
        )
