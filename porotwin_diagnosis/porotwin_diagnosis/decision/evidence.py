"""All evidence of a verdict, gathered before the decision."""

from collections.abc import Sequence
from dataclasses import dataclass

from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.explanation import Explanation
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.thresholds import (
    SCANT_CELLS,
    SCANT_FRAMES,
)
from porotwin_solver.effects import EFFECTS


@dataclass(frozen=True)
class Evidence:
    """Everything that a verdict depends on.

    Attributes:
        findings: fits of the single effects and of pairs.
        explanation: the kept model, which the verdict accepts or rejects.
        numerics: misfits of the configured and of the accurate scheme.
        cells_along: cells along the longer side of the rig, of the finest recording.
        fitted_frames: frames that the fits saw, of all recordings.
        may_have_held_tracer: whether a late clock and tracer from before a recording make the same
            maps of it.
    """

    findings: Findings
    explanation: Explanation
    numerics: Numerics
    cells_along: int
    fitted_frames: int
    may_have_held_tracer: bool = False

    @property
    def has_open_clock(self) -> bool:
        """Whether the kept model shifts the clock, and the rig may have held tracer instead."""
        moved = any(EFFECTS[name].moves_time for name in self.explanation.members)
        return self.may_have_held_tracer and moved

    @property
    def is_coarse(self) -> bool:
        """Whether cells are too large for a confident verdict."""
        return self.cells_along < SCANT_CELLS

    @property
    def has_few_frames(self) -> bool:
        """Whether frames with tracer are too few for a confident verdict."""
        return self.fitted_frames < SCANT_FRAMES

    @property
    def scant(self) -> bool:
        """Whether cells are too large, or frames too few, for a confident verdict."""
        return self.has_few_frames or self.is_coarse


def gather(
    samples: Sequence[Sample],
    findings: Findings,
    explanation: Explanation,
    numerics: Numerics,
) -> Evidence:
    """Return the evidence of a diagnosis of `samples`."""
    return Evidence(
        findings,
        explanation,
        numerics,
        cells_along=max(max(sample.grid.shape) for sample in samples),
        fitted_frames=sum(sample.fitted_frames for sample in samples),
        may_have_held_tracer=any(sample.may_have_held_tracer for sample in samples),
    )
