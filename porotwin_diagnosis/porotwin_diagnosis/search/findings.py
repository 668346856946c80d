"""The result of a search: all fits at the finest level that each has reached."""

from collections.abc import Sequence
from dataclasses import dataclass

from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.prior import NO_PRIOR, Prior


@dataclass(frozen=True)
class Findings:
    """All fits and distances that a verdict needs.

    Attributes:
        null: the model without effects, judged on fine cells.
        screened_null: the model without effects on coarse cells.
        screened: fits of single effects on coarse cells, the best first.
        singles: judged fits of single effects, the most plausible first.
        pairs: judged fits of pairs, the most plausible first.
        distances: whitened distances [-] of the predictions of `singles` from the first one.
        pair_distances: whitened distances [-] of the predictions of `pairs` from the first one.
        parts: members of the best triple or else pair, each alone with its parameters there.
        part_changes: relative L2 norm [-] of the change that each of `parts` makes in the held-out
            maps.
        runs: number of simulations that were made.
        triples: judged fits of three effects that explain clearly more than the best pair.
        prior: the belief before this recording.
        untried: what was not tried because the search was ended, in words; empty: nothing.
    """

    null: Fit
    screened_null: Fit
    screened: Sequence[Fit]
    singles: Sequence[Fit] = ()
    pairs: Sequence[Fit] = ()
    distances: Sequence[float] = ()
    pair_distances: Sequence[float] = ()
    parts: Sequence[Fit] = ()
    part_changes: Sequence[float] = ()
    runs: int = 0
    triples: Sequence[Fit] = ()
    prior: Prior = NO_PRIOR
    untried: str = ''
