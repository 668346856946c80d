"""All evidence of a verdict, gathered before the decision."""

from collections.abc import Sequence
from dataclasses import dataclass

from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.explanation import Explanation
from porotwin_diagnosis.decision.held_out import HeldOut, blurred_errors
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.thresholds import SCANT_COLUMNS, SCANT_FRAMES, WORSENED


@dataclass(frozen=True)
class Evidence:
    """Everything that a verdict depends on.

    Attributes:
        findings: fits of the single effects and of pairs.
        explanation: the kept model, which the verdict accepts or rejects.
        numerics: misfits of the configured and of the accurate scheme.
        held_out_errors: relative L2 errors of the held-out maps before and after, with predictions
            blurred as the camera blurs them.
        columns: columns of cells of the widest recording.
        fitted_frames: frames that the fits saw, of all recordings.
    """

    findings: Findings
    explanation: Explanation
    numerics: Numerics
    held_out_errors: tuple[float, float]
    columns: int
    fitted_frames: int

    @property
    def contradicted(self) -> bool:
        """Whether the kept model predicts the held-out maps worse than the configured model."""
        before, after = self.held_out_errors
        return after > WORSENED * before

    @property
    def scant(self) -> bool:
        """Whether cells are too large, or frames too few, for a confident verdict."""
        return self.fitted_frames < SCANT_FRAMES or self.columns < SCANT_COLUMNS


def gather(
    samples: Sequence[Sample],
    findings: Findings,
    explanation: Explanation,
    numerics: Numerics,
    held_out: Sequence[HeldOut],
) -> Evidence:
    """Return the evidence of a diagnosis of `samples`."""
    return Evidence(
        findings,
        explanation,
        numerics,
        blurred_errors(held_out),
        columns=max(sample.grid.nx for sample in samples),
        fitted_frames=sum(sample.fitted_frames for sample in samples),
    )
