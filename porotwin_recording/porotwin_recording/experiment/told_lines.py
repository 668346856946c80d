"""What a run said: the remarks of its cycles and the warnings of its nodes, from its bag."""

import logging
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.from_messages import time_from_msg
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_folder import bag_folder
from porotwin_recording.mcap.mcap_summary import McapSummary, summary_of

LOG = 'rosout'


class ToldLine(NamedTuple):
    """A line that was said first at `time_s` after the first cycle, and how often."""

    time_s: float
    text: str
    times: int


def lines_about(bag: Path, words: str) -> list[ToldLine]:
    """Return the lines with `words`, in any capitals, that a run said; each once.

    Args:
        bag: the bag of the run; a part that cannot be read says nothing.
        words: what is looked for.
    """
    wanted, begin = words.casefold(), 0.0
    first: dict[str, float] = {}
    count: Counter[str] = Counter()
    for part in _parts(bag):
        numbers = part.numbers(topic_names.CYCLE) | part.numbers(LOG)
        for message in part.messages(numbers, chunks=sys.maxsize):
            stamp = _stamp(message)
            if not begin and hasattr(message, 'remarks'):
                begin = stamp
            for text in _texts(message):
                if wanted in text.casefold():
                    first.setdefault(text, stamp)
                    count[text] += 1
    return [ToldLine(time - begin, text, count[text]) for text, time in first.items()]


def _parts(bag: Path) -> Iterator[McapSummary]:
    for file in bag_folder(bag).files:
        try:
            yield summary_of(file)
        except InputError:
            continue


def _texts(message: Any) -> tuple[str, ...]:
    """Return the remarks of a cycle, or the line of a node from a warning on.

    The levels of `rcl_interfaces/msg/Log` are those of Python.
    """
    if hasattr(message, 'remarks'):
        return tuple(map(str, message.remarks))
    return (f'{message.name}: {message.msg}',) if message.level >= logging.WARNING else ()


def _stamp(message: Any) -> float:
    return time_from_msg(message.header.stamp if hasattr(message, 'header') else message.stamp)
