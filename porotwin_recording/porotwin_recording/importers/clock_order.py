"""Order of photographs beside their local times: a clock that was set back shows there.

At the end of summer time a clock shows an hour twice. Photographs sorted by such times are in a
wrong order, and one of the injection may become a baseline.
"""

import itertools
import re
from collections.abc import Sequence
from datetime import datetime

from porotwin_core.basis.errors import InputError

_COUNTER = re.compile(r'(.*\D|)(\d{1,5})')
"""Name of a photograph with the counter of a camera; more digits may be a date or a time."""

LAST_COUNT = 9999
"""The counter of a camera begins again after this number."""

LONGEST_SETBACK_S = 3600.0
"""The end of summer time sets a clock back by this time at most [s]."""


def counters(stems: Sequence[str]) -> list[int] | None:
    """Return the camera's counters at the end of names; None if not every name has its own."""
    found = [_COUNTER.fullmatch(stem) for stem in stems]
    if not all(found) or len({match[1] for match in found if match}) != 1:
        return None
    numbers = [int(match[2]) for match in found if match]
    return numbers if len(set(numbers)) == len(numbers) else None


def check_order(
    times: Sequence[datetime], words: Sequence[str], where: str, numbers: Sequence[int] | None
) -> str:
    """Compare the order of photographs with their local times; return a remark, or nothing.

    Numbers tell the order. Without them the rows do, and they may be unsorted: then only a single
    fall of at most an hour is refused. Times that fall from the first to the last are a list that
    begins with the newest.

    Args:
        times: local times.
        words: the same as written.
        where: file and column, for messages.
        numbers: numbers of the photographs that rise with time; None: unknown.

    Raises:
        InputError: times fall where they should rise; the message names the row.
    """
    found = falls(times, numbers)
    if not found:
        return ''
    if len(found) == len(times) - 1 > 1:
        return f'{where}: times fall all the way: taken as a list with the newest first'
    before, after = found[0]
    fall = (times[before] - times[after]).total_seconds()
    if numbers is None and (len(found) > 1 or fall > LONGEST_SETBACK_S):
        return f'{where}: rows are not in the order of their times: sorted by time'
    first, second = (
        f'row {at + 2}' if numbers is None else f'photograph {numbers[at]}' for at in found[0]
    )
    raise InputError(
        f"{where}:{after + 2}: '{words[after]}' of {second} is earlier than '{words[before]}' of "
        f'{first}: was the clock set back? give --time-zone, such as Europe/Oslo, or write '
        f"offsets, such as '{words[after]}+01:00'; else {_remedy(numbers)}"
    )


def _remedy(numbers: Sequence[int] | None) -> str:
    return 'sort the rows by time' if numbers is None else 'correct the row'


def falls(times: Sequence[datetime], numbers: Sequence[int] | None) -> list[tuple[int, int]]:
    """Return the pairs of rows that follow each other, by number, and whose times fall.

    Args:
        times: the times of the rows.
        numbers: numbers of the photographs that rise with time; None: the rows are in order.
    """
    tried = [list(range(len(times)))]
    if numbers is not None:
        tried = [
            sorted(tried[0], key=lambda at: keys[at]) for keys in (numbers, _begun_again(numbers))
        ]
    found = [
        [(a, b) for a, b in itertools.pairwise(order) if times[b] < times[a]] for order in tried
    ]
    return min(found, key=len)


def _begun_again(numbers: Sequence[int]) -> list[int]:
    """Return numbers that rise on where a counter of four digits has begun again."""
    ordered = sorted(set(numbers))
    if not ordered or ordered[-1] > LAST_COUNT:
        return list(numbers)
    limit = next(
        (low for low, high in itertools.pairwise(ordered) if high - low > LAST_COUNT / 2), -1
    )
    return [number + (LAST_COUNT + 1) * (number <= limit) for number in numbers]
