"""All evidence of a verdict, gathered before the decision."""

from collections.abc import Sequence
from dataclasses import dataclass

from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.explanation import Explanation
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.ranking import misfit_beyond_noise
from porotwin_diagnosis.thresholds import (
    INTERVAL_DEVIATIONS,
    LOST_PLACE,
    MOST_SCALE_ERROR,
    SCANT_CELLS,
    SCANT_FRAMES,
    SUFFICIENT_MISFIT,
    WORSENED,
)
from porotwin_solver.effects import EFFECTS


@dataclass(frozen=True)
class Evidence:
    """Everything that a verdict depends on.

    Attributes:
        findings: fits of the single effects and of pairs.
        explanation: the kept model, which the verdict accepts or rejects.
        numerics: misfits of the configured and of the accurate scheme.
        held_out_errors: relative L2 errors of the held-out maps before and after, with blur and
            level of the camera.
        cells_along: cells along the longer side of the rig, of the finest recording.
        fitted_frames: frames that the fits saw, of all recordings.
        place_uncertainty: largest half width [-] of the 90 % interval of a place in the kept model,
            relative to the rig; 0 if it has no leak and no zone.
        may_have_held_tracer: whether a late clock and tracer from before a recording make the same
            maps of it.
        scale_error: deviation [-] of the size of the picture in the kept model; 0 without one.
    """

    findings: Findings
    explanation: Explanation
    numerics: Numerics
    held_out_errors: tuple[float, float]
    cells_along: int
    fitted_frames: int
    place_uncertainty: float = 0.0
    may_have_held_tracer: bool = False
    scale_error: float = 0.0

    @property
    def contradicted(self) -> bool:
        """Whether the kept model predicts the held-out maps worse than the configured model."""
        before, after = self.held_out_errors
        return after > WORSENED * before

    @property
    def has_lost_place(self) -> bool:
        """Whether a leak or a zone of the kept model may lie almost anywhere.

        A weak gap in the fitted part leaves the place of a true one open as well: a true leak at
        the limit of what can be seen left 0.41 there, two leaks that imitated a flow 0.85.
        """
        strong = misfit_beyond_noise(self.findings.null)[0] > SUFFICIENT_MISFIT
        return strong and self.leaves_place_open

    @property
    def leaves_place_open(self) -> bool:
        """Whether the place of a leak or a zone of the kept model is hardly known."""
        return self.place_uncertainty > LOST_PLACE

    @property
    def has_open_clock(self) -> bool:
        """Whether the kept model shifts the clock, and the rig may have held tracer instead."""
        moved = any(EFFECTS[name].moves_time for name in self.explanation.members)
        return self.may_have_held_tracer and moved

    @property
    def has_odd_size(self) -> bool:
        """Whether the kept model needs a picture whose size marked corners can hardly get wrong."""
        return self.scale_error > MOST_SCALE_ERROR

    @property
    def scant(self) -> bool:
        """Whether cells are too large, or frames too few, for a confident verdict."""
        return self.fitted_frames < SCANT_FRAMES or self.cells_along < SCANT_CELLS


def gather(
    samples: Sequence[Sample],
    findings: Findings,
    explanation: Explanation,
    numerics: Numerics,
    held_out_errors: tuple[float, float],
) -> Evidence:
    """Return the evidence of a diagnosis of `samples`."""
    return Evidence(
        findings,
        explanation,
        numerics,
        held_out_errors,
        cells_along=max(max(sample.grid.shape) for sample in samples),
        fitted_frames=sum(sample.fitted_frames for sample in samples),
        place_uncertainty=place_uncertainty(explanation.model),
        may_have_held_tracer=any(sample.may_have_held_tracer for sample in samples),
        scale_error=scale_error(explanation.model),
    )


def scale_error(model: Fit) -> float:
    """Return the deviation [-] of the size of the picture in `model` from the true size."""
    sizes = [effect.parameters.get('scale', 1.0) for effect in model.effects]
    return max((abs(size - 1.0) for size in sizes if isinstance(size, float)), default=0.0)


def place_uncertainty(model: Fit) -> float:
    """Return the largest half width [-] of the 90 % interval of a place in `model`, with
    covariance, relative to the range of the place; 0 without a place."""
    widths = [
        INTERVAL_DEVIATIONS * deviation * parameter.step / (parameter.high - parameter.low)
        for member, _, deviations in model.member_parameters
        if EFFECTS[member.effect].has_place
        for parameter, deviation in zip(member.parameters, deviations, strict=True)
        if parameter.name in ('x', 'z')
    ]
    return float(max(widths, default=0.0))
