"""The announced pauses of wells that the twin does not change: plans know them beforehand."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from porotwin_core.rig import Rig
from porotwin_core.units import MINUTE_S

Pause = tuple[float, float]
"""Start and end of a pause since the start of the experiment [s]."""


@dataclass(frozen=True)
class FixedPauses:
    """The announced pauses of each fixed well."""

    of_wells: Mapping[str, tuple[Pause, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, rig: Rig) -> 'FixedPauses':
        """Return the pauses in `rig.yaml`."""
        fixed = rig.control.fixed if rig.control is not None else {}
        return cls(
            {
                name: tuple((MINUTE_S * start, MINUTE_S * end) for start, end in well.pauses_min)
                for name, well in fixed.items()
                if well.pauses_min
            }
        )

    def moments(self, begin: float, end: float) -> set[float]:
        """Return when a pause begins or ends between `begin` and `end` [s], both left out."""
        edges = {edge for pauses in self.of_wells.values() for pause in pauses for edge in pause}
        return {edge for edge in edges if begin < edge < end}

    def resting(self, time: float) -> frozenset[str]:
        """Return the wells that pause at `time` [s]."""
        return frozenset(
            name
            for name, pauses in self.of_wells.items()
            if any(start <= time < end for start, end in pauses)
        )


NO_PAUSES = FixedPauses()
"""No fixed well pauses."""
