"""How a photograph changes the belief of the siblings, and their spread."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.geometry.map_blocks import Blocks, error_variance
from porotwin_core.rates.delivered_rates import MEMORY_S, PumpFactor
from porotwin_siblings.belief import Belief, standard_scores
from porotwin_siblings.photograph import Photograph
from porotwin_siblings.unknowns import Sibling, Unknowns

FEATURE_FLOOR = 0.005
"""Difference of the mean of a block that means nothing [-]."""

INFLATION_SHARE = 0.5
"""Weight of a new photograph in the inflation of the spread."""

LEAST_INFLATION, MOST_INFLATION = 1.0, 4.0
"""Range of the inflation: the belief itself, and as far as the effects stay linear."""


class Learning:
    """The belief of all siblings together.

    Attributes:
        belief: the distribution of their unknowns.
        inflation: factor on their spread, for causes that no sibling knows.
    """

    def __init__(self, unknowns: Unknowns, grid: Grid, count: int) -> None:
        """Begin with the belief before any photograph.

        Args:
            unknowns: of the siblings.
            grid: of the siblings.
            count: number of siblings.

        Raises:
            InputError: there are too few siblings.
        """
        self._unknowns = unknowns
        self._grid = grid
        self._blocks = Blocks.of(grid)
        self._scores = standard_scores(unknowns.count, count, seed=1)
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget everything."""
        count = self._unknowns.count
        self.belief = self._prior = Belief.independent(np.zeros(count), np.ones(count))
        self.inflation = 1.0
        self.believe({})

    def believe(self, pumps: Mapping[str, PumpFactor]) -> None:
        """Believe in the rate factors of the `pumps` by well as the hub does, and doubt them alike.

        Others count as before any photograph.
        """
        told = [
            (place, math.log(pump.unmetered) / step, pump.deviation / pump.factor / step)
            if (pump := pumps.get(well))
            else (place, 0.0, 1.0)
            for well, (place, step) in self._unknowns.pumps.items()
        ]
        places, mean, deviation = np.array(told).reshape(-1, 3).T
        # a belief without any doubt could never change again: its covariance would be singular
        self._pumps = places.astype(int), mean, np.maximum(deviation, WRITTEN_ROUND_OFF)
        self._prior = self._prior.with_marginal(*self._pumps, linear=MOST_INFLATION)
        self.belief = self.belief.with_marginal(*self._pumps, linear=MOST_INFLATION)

    def members(self) -> list[Sibling]:
        """Return every sibling."""
        drawn = self.belief.members(self.inflation * self._scores)
        return [self._unknowns.sibling(values) for values in drawn.T]

    def mean(self) -> Sibling:
        """Return the sibling of the mean belief."""
        return self._unknowns.sibling(self.belief.mean)

    def fade(self, elapsed: float) -> None:
        """Let the belief fade to that before any photograph over `elapsed` [s]."""
        self.belief = self.belief.relaxed(self._prior, 1.0 - math.exp(-elapsed / MEMORY_S))

    def learn(
        self,
        photograph: Photograph,
        siblings: Sequence[Sibling],
        maps: Sequence[FloatArray],
        *,
        alike: float,
    ) -> None:
        """Update belief and inflation; a photograph that hides all blocks tells nothing.

        Args:
            photograph: the newest one, on any grid of the rig.
            siblings: all of them.
            maps: the map (nz, nx) that each of them expected, on their grid.
            alike: photographs that judge nearly the same course, this one included.
        """
        map_, random, systematic = (
            conservative_resample(values, self._grid.shape)
            for values in (photograph.concentration, photograph.random**2, photograph.systematic)
        )
        seen = np.isfinite(map_)
        expected = np.array(
            [
                one + sibling.photograph_error * systematic
                for one, sibling in zip(maps, siblings, strict=True)
            ]
        )
        predicted = self._blocks.means(expected, seen).T
        observed = self._blocks.means(map_, seen)
        if not observed.size:  # a hand before the camera: no block shows enough
            return
        noise = self._blocks.means(random, seen)
        variance = error_variance(noise, alike=max(1.0, alike))
        self.belief = self.belief.updated(
            self.inflation * self._scores, predicted, observed, variance
        ).with_marginal(*self._pumps, linear=MOST_INFLATION)
        self._inflate(predicted, observed, noise)

    def _inflate(self, predicted: FloatArray, observed: FloatArray, noise: FloatArray) -> None:
        """Spread the siblings by the distance of the photograph from their expectations.

        A cause that no sibling knows shows as a difference larger than their spread (adaptive
        inflation; Anderson, Tellus A 61 (2009) 72-83).
        """
        missed = float(np.sum((observed - predicted.mean(axis=1)) ** 2))
        spread = float(np.sum(predicted.var(axis=1) + noise + FEATURE_FLOOR**2))
        wanted = self.inflation * math.sqrt(missed / spread)
        moved = self.inflation + INFLATION_SHARE * (wanted - self.inflation)
        self.inflation = min(max(moved, LEAST_INFLATION), MOST_INFLATION)
