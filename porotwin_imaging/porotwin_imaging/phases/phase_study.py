"""The phases in all photographs of an experiment: colours from a few of them, then map by map.

study = PhaseStudy.of(photographs, baseline, boxes)
found = study.phases(jpeg_bytes)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.calibrating.mass_balance_fit import MASS_BALANCE
from porotwin_imaging.phases.colour_change import Box, ColourChange, colour_change
from porotwin_imaging.phases.phase_colours import PHASES, WATER, PhaseColours
from porotwin_imaging.phases.phase_fit import found_colours, given_colours
from porotwin_imaging.phases.phase_segmentation import PhaseMap, segment_phases

Boxes = Mapping[int, Sequence[Box]]
"""Boxes of the rig by the number of the phase that they show."""


@dataclass(frozen=True)
class PhaseStudy:
    """All that is known before a photograph is segmented.

    Attributes:
        baseline: the baseline of the photographs.
        water: boxes that always show water.
        colours: the colours of the phases.
    """

    baseline: Baseline
    water: tuple[Box, ...]
    colours: PhaseColours

    @classmethod
    def of(
        cls,
        photographs: Mapping[float, Callable[[], bytes]],
        baseline: Baseline,
        boxes: Boxes,
    ) -> Self:
        """Find the colours of the phases.

        Args:
            photographs: readers of the files by time [s], in order.
            baseline: the baseline.
            boxes: places that a person knows; without any of dissolved CO2 or gas, colours are
                found.

        Raises:
            InputError: the colours cannot be found, or the boxes contradict each other.
        """
        water = tuple(boxes.get(WATER, ()))
        given = {phase: found for phase, found in boxes.items() if found and phase != WATER}
        changes = _changes(photographs, baseline, water, given)
        cells = _cells(water, baseline)
        colours = (
            given_colours(changes, given, cells, baseline.grid)
            if given
            else found_colours(list(changes.values()), cells)
        )
        return cls(baseline, water, colours)

    def phases(self, data: bytes) -> PhaseMap:
        """Return the phases in the photograph `data` (bytes of the file).

        Raises:
            InputError: the photograph cannot be used.
        """
        change = colour_change(data, self.baseline, self.water)
        return segment_phases(change, self.colours, _cells(self.water, self.baseline))

    def missing(self) -> list[str]:
        """Return the names of the phases without a colour."""
        return [name for number, name in enumerate(PHASES) if number not in self.colours.phases]


def _cells(boxes: Sequence[Box], baseline: Baseline) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) that lie in any of the boxes."""
    inside = np.zeros(baseline.grid.shape, bool)
    for box in boxes:
        inside |= box.cells(baseline.grid)
    return inside


def _changes(
    photographs: Mapping[float, Callable[[], bytes]],
    baseline: Baseline,
    water: Sequence[Box],
    given: Boxes,
) -> dict[float, ColourChange]:
    """Return the changes of colour in the photographs that tell the colours, by time.

    Photographs that cannot be used are left out.

    Raises:
        InputError: none can be used.
    """
    times = np.array(list(photographs))
    count = min(len(times), MASS_BALANCE.independent_photographs)
    chosen = {int(n) for n in np.linspace(0, len(times) - 1, count).round()}
    for box in (box for boxes in given.values() for box in boxes):
        chosen.add(len(times) - 1 if box.time is None else int(np.abs(times - box.time).argmin()))
    changes: dict[float, ColourChange] = {}
    reason = ''
    for time in times[sorted(chosen)]:
        try:
            changes[float(time)] = colour_change(photographs[float(time)](), baseline, water)
        except (InputError, OSError) as error:
            reason = str(error)
    if not changes:
        raise InputError(f'no photograph can be used; the last one: {reason}')
    return changes
