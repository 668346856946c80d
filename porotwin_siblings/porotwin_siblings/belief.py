"""The belief of all siblings together: a normal distribution of their unknowns, and its update.

The siblings are fixed standard scores times the spread of the belief. The scores have zero mean,
unit covariance and no correlation, so that a regression of anything the siblings predict on their
scores is its derivative by the unknowns, averaged over their spread (statistical linearisation;
Garcia-Fernandez et al., IEEE Trans. Signal Process. 63 (2015) 5561-5573). An update by photographs
is then the ensemble smoother in the space of the unknowns, free of the spurious correlations that a
small ensemble has in the space of its members (Evensen et al., Data Assimilation Fundamentals,
2022, ch. 13).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray


def standard_scores(unknowns: int, siblings: int, seed: int) -> FloatArray:
    """Return scores (unknowns, siblings) with zero mean and unit covariance, to round-off.

    Raises:
        InputError: there are too few siblings for that.
    """
    if siblings <= unknowns:
        raise InputError(
            f'siblings {siblings}: {unknowns} unknowns need at least {unknowns + 1}; '
            'set the parameter siblings'
        )
    drawn = np.random.default_rng(seed).standard_normal((siblings, unknowns))
    orthonormal, _ = np.linalg.qr(drawn - drawn.mean(axis=0))
    return np.asarray(orthonormal.T * np.sqrt(siblings))


@dataclass(frozen=True)
class Belief:
    """A normal distribution: `mean` (unknowns,) and `covariance` (unknowns, unknowns)."""

    mean: FloatArray
    covariance: FloatArray

    @classmethod
    def independent(cls, mean: FloatArray, deviation: FloatArray) -> 'Belief':
        """Return the belief in independent unknowns with `mean` and `deviation`, (unknowns,)."""
        return cls(mean, np.diag(deviation**2))

    @property
    def deviation(self) -> FloatArray:
        """Standard deviation of every unknown, (unknowns,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def root(self) -> FloatArray:
        """The symmetric root of the covariance in units of the deviations, times these.

        It moves each sibling as little as possible from one update to the next.
        """
        scale = self.deviation
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        symmetric = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        return scale[:, None] * symmetric

    def members(self, scores: FloatArray) -> FloatArray:
        """Return the unknowns of every sibling, (unknowns, siblings), from their `scores`."""
        return self.mean[:, None] + self.root @ scores

    def with_marginal(
        self,
        places: NDArray[np.int_],
        mean: FloatArray,
        deviation: FloatArray,
        *,
        linear: float,
    ) -> 'Belief':
        """Return the belief with the marginal of somebody else in the unknowns at `places`.

        The belief in the others, given these, stays as it is (Jeffrey, The Logic of Decision, 1983,
        ch. 11).

        Args:
            places: of the unknowns.
            mean: theirs, (places,).
            deviation: theirs, independent of each other, (places,).
            linear: a mean that changes by more tells nothing about the others any more.
        """
        before, change = self.covariance.copy(), mean - self.mean[places]
        far = places[np.abs(change) > linear]
        before[far, :] = before[:, far] = 0.0
        before[far, far] = 1.0
        marginal = before[np.ix_(places, places)]
        slope = np.linalg.solve(marginal, before[places]).T
        after = before + slope @ (np.diag(deviation**2) - marginal) @ slope.T
        return Belief(self.mean + slope @ change, 0.5 * (after + after.T))

    def relaxed(self, prior: 'Belief', share: float) -> 'Belief':
        """Return the belief after `share` of the knowledge has faded to `prior`.

        It keeps the prior's variance in the long run (an Ornstein-Uhlenbeck process).
        """
        keep = 1.0 - share
        return Belief(
            prior.mean + keep * (self.mean - prior.mean),
            prior.covariance + keep**2 * (self.covariance - prior.covariance),
        )

    def updated(
        self,
        scores: FloatArray,
        predicted: FloatArray,
        observed: FloatArray,
        variance: FloatArray,
    ) -> 'Belief':
        """Return the belief after an observation.

        Args:
            scores: of the siblings, (unknowns, siblings), times any inflation of their spread.
            predicted: the observation that each sibling expected, (observations, siblings).
            observed: (observations,).
            variance: of the errors of observation and model, (observations,).
        """
        siblings = predicted.shape[1]
        expected = predicted.mean(axis=1)
        slope = (predicted - expected[:, None]) @ scores.T / (siblings * np.mean(scores**2))
        weighted = slope / variance[:, None]
        precision = np.eye(len(self.mean)) + slope.T @ weighted
        covariance = np.linalg.inv(precision)
        step = covariance @ (weighted.T @ (observed - expected))
        root = self.root
        updated = root @ covariance @ root.T
        return Belief(self.mean + root @ step, 0.5 * (updated + updated.T))
