"""The bounds of a prediction: its length, its cost, and a check between its steps."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from porotwin_core.basis.errors import InputError

CELL_UPDATES_PER_S = 1e7
"""Cell updates of one core per second beside a busy graph; an idle core does up to 1e8."""


def _go_on() -> None:
    """Let the prediction go on."""


@dataclass(frozen=True)
class Supervision:
    """The bounds of one prediction.

    longest_s: longest time [s] that it may cover.
    most_cell_updates: most updates of single cells, in all substeps together.
    check: called between two steps; it raises an error to end the prediction.
    """

    longest_s: float = math.inf
    most_cell_updates: float = math.inf
    check: Callable[[], None] = _go_on

    def refuse_too_long(self, duration: float) -> None:
        """Return if a prediction over `duration` [s] may begin.

        Raises:
            InputError: it is too long.
        """
        if duration > self.longest_s:
            raise InputError(
                f'prediction over {duration:g} s: the longest one is {self.longest_s:g} s; '
                'ask for a shorter time'
            )

    def refuse_too_costly(self, cell_updates: int, duration: float) -> None:
        """Return if a prediction over `duration` [s] may cost `cell_updates`.

        Raises:
            InputError: it costs too much; the message holds the estimated time.
        """
        if cell_updates > self.most_cell_updates:
            minutes = cell_updates / CELL_UPDATES_PER_S / 60.0
            raise InputError(
                f'prediction over {duration:g} s: {cell_updates:.2g} cell updates, about '
                f'{minutes:.2g} minutes; at most {self.most_cell_updates:.2g} are allowed; ask for '
                'a shorter time, smaller rates, weaker effects or a coarser grid'
            )


UNSUPERVISED = Supervision()
"""No bounds."""
