"""The search for what explains a gap: every effect alone, then in pairs, coarse before fine.

1. Screening: every candidate is fitted with the full model on cells twice as large (`singles`).
2. Refinement: what is left is fitted again on the recording's cells, and judged on cells half as
   large, where the scheme smears least, with what the finest cells change in one run of each
   (`levels`).
3. Pairs, where no single effect closes the gap, in the same steps (`pairs`).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.progress import Progress
from porotwin_diagnosis.search.levels import REFINED, Levels
from porotwin_diagnosis.search.pairs import PairSearch
from porotwin_diagnosis.search.ranking import (
    EXPLAINED,
    distinct,
    labels,
    near,
    normalised_misfit,
    score,
)
from porotwin_diagnosis.search.singles import Singles

SMALL_GAP = 4.0
"""Misfit of a model below which coarse runs are corrected by what finer cells change in it: the
model as it is, or the best single effect where no pair was found. Above it fronts lie too far apart
for that correction to stay in place."""

WORTH_EXCHANGING = 3.0
"""Excess of a judged pair below which its members may make way for others once more."""


@dataclass
class Findings:
    """All fits at the finest level each has reached; `null` and
    `screened_null` are the model without any effect, judged and as screened.

    `distances` are those of the predictions of all `singles` from the best one's, `pair_distances`
    those of `pairs`. `parts` are the members of the best pair, each alone with the parameters that
    it has there, `part_changes` the relative L2 norms of what each changes in the held-out maps.
    """

    null: Fit
    screened_null: Fit
    screened: list[Fit]
    singles: list[Fit] = field(default_factory=list)
    pairs: list[Fit] = field(default_factory=list)
    distances: list[float] = field(default_factory=list)
    pair_distances: list[float] = field(default_factory=list)
    parts: list[Fit] = field(default_factory=list)
    part_changes: list[float] = field(default_factory=list)
    runs: int = 0


class Search:
    """Looks for effects in recordings of one rig."""

    def __init__(
        self,
        samples: Sequence[Sample],
        *,
        excluded: Collection[str] = (),
        progress: Progress = lambda _stage, _share: None,
        workers: int = 2,
    ) -> None:
        """Search `samples` without the effects named in `excluded`."""
        self.levels = Levels(samples, progress=progress, workers=workers)
        self._singles = Singles(self.levels, excluded)
        self._pairs = PairSearch(self.levels, self._singles)

    def run(self) -> Findings:
        """Return what was found."""
        levels = self.levels
        levels.progress('running the model as it is', 0.0)
        null = levels.null()
        if score(null) < SMALL_GAP:
            levels.lean(())
        screened = self._singles.screened()
        screened_null = levels.screening.judged((), np.zeros(0))
        refined = levels.refined(near(distinct(screened))[:REFINED], 0.3)
        singles = levels.sharpened(levels.judged(refined, 0.4), null, 0.48)
        levels.attune(null)
        findings = Findings(levels.null(), screened_null, screened, singles)
        if normalised_misfit(singles[0]) > EXPLAINED:
            findings.pairs = self._found_pairs(findings)
            if findings.pairs:
                levels.attune(findings.pairs[0])
        findings.parts = [
            levels.judging.judged((member,), scaled)
            for pair in findings.pairs[:1]
            for member, scaled, _ in pair.parts()
        ]
        self._tried_again_alone(findings)
        findings.part_changes = [levels.change(part.effects) for part in findings.parts]
        findings.distances = levels.distances(findings.singles)
        findings.pair_distances = levels.distances(findings.pairs)
        findings.runs = levels.runs
        return findings

    def _found_pairs(self, findings: Findings) -> list[Fit]:
        """Return the judged pairs, more of them where the first leave something."""
        best, null, screened = findings.singles[0], findings.null, findings.screened
        pairs = self._pairs.judged(screened, best, null)
        if (not pairs or normalised_misfit(pairs[0]) > EXPLAINED) and score(best) < SMALL_GAP:
            self.levels.lean(best.effects)
            again = self._singles.screened_again(best, screened)
            pairs = self.levels.ranked([*pairs, *self._pairs.judged(again, best, null)])
        for pair in worth_exchanging(pairs):
            if normalised_misfit(pairs[0]) > EXPLAINED:
                more = self._pairs.judged_beside(pair, screened, null)
                pairs = self.levels.ranked([*pairs, *more])
        return pairs

    def _tried_again_alone(self, findings: Findings) -> None:
        """Fit a member of the best pair alone once more if, as it is there, it leaves less than
        every single fit: its own stood still before it found its place."""
        moved = [part for part in findings.parts if score(part) < score(findings.singles[0])]
        if moved:
            again = self.levels.judged(self.levels.refined(moved, 0.89), 0.9)
            fits = [*self.levels.sharpened(again, findings.null, 0.9), *findings.singles]
            findings.singles = self.levels.ranked(fits)


def worth_exchanging(pairs: Sequence[Fit]) -> list[Fit]:
    """Return the best of the judged `pairs` and the best that shares no effect with it, which one
    of many parameters may imitate."""
    first = labels(pairs[0].members) if pairs else frozenset()
    unlike = [pair for pair in pairs if first.isdisjoint(labels(pair.members))]
    return [
        pair for pair in (*pairs[:1], *unlike[:1]) if normalised_misfit(pair) < WORTH_EXCHANGING
    ]
