"""Notices from photographs that a pump delivers nothing, far less or far more than it is told.

A pump without a flow meter may stop, or its tube may come loose, and nobody sees it. Each well that
pumps is a hypothesis: "it has delivered this share since some minutes". Predictions from a
state some minutes ago tell what the photograph would show then. The hypothesis with the likeliest
photograph is compared with "all as told". The usual doubt of rates, model and camera is part of
the likelihood, so that it takes more than a weak pump to become sure (Bayes factors; Kass and
Raftery, J. Am. Stat. Assoc. 90 (1995) 773-795).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.tracer_volume import CHANGE_LOG_ODDS, CHANGED_SHARE
from porotwin_hub.models.plant_knowledge import DEAD_SHARE, STANDS

WATCH_S = 120.0
"""Time between two tests [s]; each takes a prediction for every pumping well."""

WATCH_WINDOW_S = 600.0
"""Time over which a prediction is compared with the photograph [s]."""

TESTS_IN_TURN = 2
"""Tests that must speak for a fault of the same well: one photograph may be a bad one."""

MOST_SHARE = 0.6
"""Greatest share of its rate that counts as a fault, and as far above 1: the rate factors follow
smaller ones."""

EMPTY = 0.03
"""Mean concentration of a block below which it tells nothing, and likewise below 1 [-]."""

REST_S = 1800.0
"""Time at rest after which a faulty pump is tried again [s]: it may have been mended."""


class Fault(NamedTuple):
    """A pump that delivers a `share` of its rate; `rested` is how long it was told to stand [s]."""

    share: float
    rested: float = 0.0


class Expectations(NamedTuple):
    """A photograph as means of blocks.

    Attributes:
        observed: the observed means, (blocks,).
        usual: if all is as believed, (blocks,).
        changed: if one well delivers another share of its rate; by well and share, (blocks,).
        variance: of the errors of photograph and model, (blocks,).
        doubts: one standard deviation of each doubt about rates and camera, (doubts, blocks).
    """

    observed: FloatArray
    usual: FloatArray
    changed: Mapping[tuple[str, float], FloatArray]
    variance: FloatArray
    doubts: FloatArray


class PumpWatch:
    """Follows which pumps have a fault, by photographs alone."""

    def __init__(self) -> None:
        """Know of no fault."""
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget everything."""
        self.faults: dict[str, Fault] = {}
        """The pumps that are believed to deliver another share, by well."""
        self._suspect, self._shares = '', [1.0]

    def share(self, well: str) -> float:
        """Return the share of its rate that a pump is believed to deliver."""
        return self.faults[well].share if well in self.faults else 1.0

    def shares(self, well: str) -> tuple[float, ...]:
        """Return the shares that a photograph is compared with; of a pump at fault, that it works.

        More and less are told by different places, so that neither follows from the other.
        """
        return (1.0,) if well in self.faults else (0.0, 1.0 + CHANGED_SHARE)

    def rest(self, idle: Sequence[str], elapsed: float) -> None:
        """Take that the `idle` wells were told to stand for `elapsed` [s].

        After a long rest a faulty pump is tried again.
        """
        for well in [well for well in idle if well in self.faults]:
            rested = self.faults[well].rested + elapsed
            self.faults[well] = self.faults[well]._replace(rested=rested)
            if rested > REST_S:
                del self.faults[well]

    def forget(self, well: str) -> None:
        """Forget the fault of a `well`: a meter or a person knows better."""
        self.faults.pop(well, None)

    def test(self, expect: Callable[[], Expectations]) -> list[str]:
        """Compare a photograph with the hypotheses; return a line for each new belief."""
        seen = expect()
        well, share, log_odds = likeliest(seen)
        if not well or log_odds < CHANGE_LOG_ODDS:
            self._suspect, self._shares = '', []
            return []
        self._shares = [*self._shares, share] if well == self._suspect else [share]
        self._suspect = well
        if len(self._shares) < TESTS_IN_TURN:
            return []
        self._suspect, self._shares, shares = '', [], self._shares
        if well in self.faults:
            del self.faults[well]
            return [f'{well} delivers again, by the photographs; it is used as before']
        return self._believe(well, float(np.mean(shares)))

    def _believe(self, well: str, share: float) -> list[str]:
        """Take a fault of a `well` into the belief."""
        if abs(1.0 - share) < 1.0 - MOST_SHARE:
            return []
        stands = share < DEAD_SHARE
        self.faults[well] = Fault(STANDS if stands else share)
        told = 'nothing' if stands else f'about {percent(share)} of its rate'
        line = f'{well} seems to deliver {told}, by the photographs: check its pump and tube'
        return [f'{line}; the plan goes on without it' if stands else line]


def likeliest(seen: Expectations) -> tuple[str, float, float]:
    """Return the well whose change explains a photograph best.

    Returns:
        The well, or '' if none pumps; the share of its rate that explains the photograph best; the
        log of the ratio of the likelihoods with and without the change.
    """
    left = seen.observed - seen.usual
    weigh = _weighing(seen.variance, seen.doubts)
    best = ('', 1.0, 0.0)
    misfits = [float(left @ weigh(left))]
    for (well, share), changed in seen.changed.items():
        change = changed - seen.usual
        weighed = weigh(change)
        size = float(change @ weighed)
        if size <= 0.0:
            continue
        part = min(max(float(left @ weighed) / size, 0.0), 1.0)
        gain = 2.0 * part * float(left @ weighed) - part**2 * size
        misfits.append(misfits[0] - gain)
        if 0.5 * gain > best[2]:
            best = (well, 1.0 + part * (share - 1.0), 0.5 * gain)
    # a misfit that no hypothesis explains has another cause, and makes all of them less sure
    within = np.maximum(seen.observed, seen.usual), np.minimum(seen.observed, seen.usual)
    telling = (within[0] > EMPTY) & (within[1] < 1.0 - EMPTY)
    unexplained = max(1.0, min(misfits) / max(int(telling.sum()), 1))
    return (*best[:2], best[2] / unexplained)


def _weighing(variance: FloatArray, doubts: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return the product with the inverse of diag(`variance`) + `doubts`^T `doubts` (Woodbury)."""
    scaled = doubts / variance
    inner = np.eye(len(doubts)) + scaled @ doubts.T

    def weigh(values: FloatArray) -> FloatArray:
        return np.asarray(values / variance - scaled.T @ np.linalg.solve(inner, scaled @ values))

    return weigh
