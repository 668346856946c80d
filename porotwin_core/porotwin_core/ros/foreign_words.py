"""Words that came over the graph: harmless on a terminal, told with their sender, and not too many.

Any node can send any text. On a terminal a text may clear the screen, write over other lines, or
look like an order for a pump. All such texts pass through this module before a person reads them.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable, Collection

from porotwin_core.basis.plain_text import plain
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S

LONGEST_WORDS = 500
"""Longest text that is told of one sender [characters]: six lines of a terminal."""

FEW = 10
"""Remarks of one sender, or about one topic, that are told in a period; the others are counted."""

PERIOD_S = USUAL_PHOTO_INTERVAL_S
"""That period [s]: a photograph later a person knows of a flood."""

OTHERS = 'nodes that are not of the twin'
"""Stands for all senders that are not known: names can be made up without an end."""


def in_short(text: str) -> str:
    """Return `text` plain, without gaps and with at most `LONGEST_WORDS` characters."""
    most = LONGEST_WORDS
    words = ' '.join(plain(text[: 2 * most]).split())
    return words if len(words) <= most and len(text) <= 2 * most else f'{words[:most]} ...'


def said(sender: str, text: str) -> str:
    """Return the words of a sender in one line, such as `'lamp' says: "the light is off"`.

    The `sender` is the name that came with the `text`, which ROS 2 does not prove.
    """
    name, words = (in_short(one).replace(quote, f'\\{quote}')
                   for one, quote in ((sender, "'"), (text, '"')))  # fmt: skip
    return f'\'{name}\' says: "{words}"'


class FewWords:
    """Tells a few lines about each sender, and of the others only how many there were."""

    def __init__(
        self,
        tell: Callable[[str], object],
        *,
        known: Collection[str] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Begin the first period.

        Args:
            tell: receives each line.
            known: senders that are counted one by one; all others count as one.
            clock: returns a steady time [s].
        """
        self._tell = tell
        self._known = frozenset(known)
        self._clock = clock
        self._lock = threading.Lock()
        self._began = clock()
        self._told: Counter[str] = Counter()

    def tell(self, sender: str, line: str) -> None:
        """Tell a `line` about the words of `sender`, unless there were many in this period."""
        self.look()
        name = sender if sender in self._known else OTHERS
        with self._lock:
            self._told[name] += 1
            few = self._told[name] <= FEW
        if few:
            self._tell(line)

    def look(self) -> None:
        """Begin a new period if it is time, and tell how many lines were left out in the last."""
        with self._lock:
            if self._clock() - self._began < PERIOD_S:
                return
            told, self._told, self._began = self._told, Counter(), self._clock()
        for name, count in told.items():
            if count > FEW:
                self._tell(f'{count - FEW} more lines of {name} are not shown')
