"""The colours of water, dissolved CO2 and gas: how each phase changes the light of the baseline.

Water with a pH indicator fills the pores of the baseline. CO2 that dissolves changes the colour of
the indicator. Gas drives the water away: the colour of the indicator is gone, and dry sand is
brighter. The change of light in a channel follows the light b of the sand as

    change = a + m b.

The colour of the fluid itself adds a, whatever the sand; a filter before the grains adds m b. Both
come from all sands together, so that a sand where little is seen borrows from its neighbours.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.phases.colour_change import ColourChange


@dataclass(frozen=True)
class PhaseSettings:
    """Maps of water, dissolved CO2 and gas (`phase_fit.py`, `phase_segmentation.py`)."""

    least_spread: float = 0.03
    """Standard deviation of colours that is added to the scatter, relative to the light of the
    sand [-]: lamps and grains cause it where nothing has changed."""
    same_hue: float = 0.9
    """Cosine between two changes, scaled by their scatter, from which they are one colour, strong
    and pale [-]. It is 0.98 and more at pale fronts, 0.5 to 0.8 between gas and dissolved CO2."""
    stiffness: float = 0.02
    """Information of the prior, a and m near 0, relative to that of the cells [-]."""
    coupling: float = 4.0
    """Gain in log probability if all neighbours have the same phase [-]."""


PHASE = PhaseSettings()


Array = NDArray[Any]

PHASES = ('water', 'dissolved', 'gas')
"""Names of the phases; their numbers in maps are the indices."""
WATER, DISSOLVED, GAS = range(3)
UNKNOWN = 255
"""Number of cells without a phase."""
CHANNELS = ('red', 'green', 'blue')


@dataclass(frozen=True)
class PhaseColours:
    """The colours of all phases; a phase may have several. The first one is water, without change.

    Attributes:
        phase: number of the phase of each colour, shape (n,).
        law: a and m of each colour and channel, shape (n, 2, 3 = red, green, blue).
        spread: covariance of the change about its colour, shape (3, 3).
    """

    phase: NDArray[np.int64]
    law: Array
    spread: Array

    @property
    def phases(self) -> tuple[int, ...]:
        """The phases that have a colour, in ascending order."""
        return tuple(int(number) for number in np.unique(self.phase))

    @property
    def typical(self) -> Array:
        """The change of each colour in sand of median light, shape (n, 3)."""
        return np.asarray(self.law.sum(axis=1))

    def expected(self, number: int, light: Array) -> Array:
        """Return the change by the colour `number` in sand of `light`, both (..., 3)."""
        return np.asarray(self.law[number, 0] + self.law[number, 1] * light)

    def costs(self, change: ColourChange) -> NDArray[np.float32]:
        """Return half of the squared distance from each colour, shape (n, nz, nx)."""
        diagonal = change.variance[..., None] * np.eye(len(CHANNELS))
        inverse = np.linalg.inv(self.spread + diagonal)
        costs = np.empty((len(self.phase), *change.reason.shape), np.float32)
        for number in range(len(self.phase)):
            away = change.change - self.expected(number, change.light)
            costs[number] = 0.5 * np.einsum('...i,...ij,...j', away, inverse, away)
        return costs

    def darken_only(self) -> bool:
        """Return whether all colours are darker than water in every channel, as those of a dye."""
        change = self.typical[1:]
        return bool(len(change) and (change < -PHASE.least_spread).all())

    def words(self) -> list[str]:
        """Return each colour but water in words, as it changes sand of median light."""
        lines = []
        for number, change in zip(self.phase[1:], self.typical[1:], strict=True):
            parts = (
                f'{name} {100 * value:+.0f} %' for name, value in zip(CHANNELS, change, strict=True)
            )
            lines.append(f'{PHASES[number]}: {", ".join(parts)} against water')
        return lines
