"""Remarks about many photographs, with one line for those that repeat."""

import re
from collections.abc import Sequence

MOST_ALONE = 2
"""Equal remarks up to this number keep a line each."""

_NUMBER = re.compile(r'\d+(\.\d+)?')


def lines_of_remarks(remarks: Sequence[tuple[float, str]], photographs: int) -> list[str]:
    """Return the lines that tell `remarks`, pairs of the time of a photograph [s] and a remark.

    Remarks that differ by their numbers only get one line: how many of all `photographs` have it,
    the time of the first one, and its remark.
    """
    alike: dict[str, list[tuple[float, str]]] = {}
    for time, remark in remarks:
        alike.setdefault(_NUMBER.sub('0', remark), []).append((time, remark))
    lines = []
    for found in alike.values():
        if len(found) <= MOST_ALONE:
            lines += [f'photograph at {time:g} s: {remark}' for time, remark in found]
        else:
            time, remark = found[0]
            count = f'{len(found)} of {photographs} photographs'
            lines.append(f'{count}, the first at {time:g} s: {remark}')
    return lines
