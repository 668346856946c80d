"""A cause that the model may miss, with the change that it makes in the maps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.effects.definition.effect import Process

MOST_CHANGE = 1.0
"""Largest believed change of a rate, or glow over stock [-]: nothing, or twice."""

Amounts = Sequence[float]
"""Fitted factors of the changes of a cause, one for each."""

Place = tuple[float, float]
"""A place (x, z) in the rig [m]."""

CHECKS = {
    Process.SOURCE: 'weigh the bottle of every pump each minute during an injection',
    Process.TRANSPORT: (
        'inject a short pulse from another well: an error of the sand stays where it is, a flow '
        'from outside moves every plume alike'
    ),
    Process.STORAGE: (
        'stop all pumps for an hour and go on photographing: tracer that sorbs, fades or enters '
        'still water goes on changing'
    ),
    Process.CAMERA: (
        'photograph the rig with all pumps at rest for as long as the recording lasts: '
        'changes come from the camera or its light then'
    ),
}
"""How to check a cause of each process without the model."""


def anywhere(_amounts: Amounts) -> bool:
    """Accept all amounts."""
    return True


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause that the model may miss.

    Attributes:
        name: short name; causes with one name differ in their place or period only.
        process: the process that it changes.
        unit: unit of its amounts.
        changes: change of the maps [-] by an amount of 1, to first order, (n, nt, nz, nx); in a
            regression the change of the whitened remainder, (n, nt, nz', nx').
        words: returns the cause with these amounts in words.
        place: its place, or None if it acts everywhere.
        freedom: number of values that a search chooses: amounts, place, period.
        allows: returns whether these amounts are possible.
        own_check: how to check this cause without the model; empty for the check of its process.
    """

    name: str
    process: Process
    unit: str
    changes: FloatArray
    words: Callable[[Amounts], str]
    place: Place | None = None
    freedom: int = 1
    allows: Callable[[Amounts], bool] = anywhere
    own_check: str = ''

    @property
    def check(self) -> str:
        """How to check the cause in the laboratory."""
        return self.own_check or CHECKS[self.process]
