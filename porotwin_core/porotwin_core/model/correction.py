"""The answer of the data-driven model: the corrective source term sigma, or a reason for none."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS, LearntPhysics
from porotwin_core.rates.wells import WellRates


@dataclass(frozen=True)
class Correction:
    """The corrective source term `sigma` (nz, nx) [1/s], or None; `status` gives the reason.

    `learnt` is the physics that sigma stands for, for models over longer times.
    """

    sigma: FloatArray | None
    status: str
    learnt: LearntPhysics = NO_LEARNT_PHYSICS

    @property
    def applied(self) -> bool:
        """Whether there is a sigma to apply."""
        return self.sigma is not None

    def applied_to(
        self, predicted: FloatArray, correct: Callable[[FloatArray], FloatArray]
    ) -> FloatArray:
        """Return the corrected prediction (nz, nx), within 0..1; `predicted` without a sigma.

        `correct` is the physics-based model: it solves L c = f_c + sigma for c (paper, eq.
        costa_residual). The result is clipped, because a correction may overshoot.
        """
        return predicted if self.sigma is None else np.clip(correct(self.sigma), 0.0, 1.0)


CorrectionFn = Callable[[FloatArray, WellRates, float, FloatArray], Correction]
"""(predicted c~^(n+1), rates, time step [s], previous c^n) -> correction (paper, eq. sigmadef)."""
