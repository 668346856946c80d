"""Uncertainty of fitted parameters, from the residuals and from the resolution."""

from dataclasses import replace

import numpy as np

from porotwin_diagnosis.decision.explanation import Explanation
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.search.findings import Findings


def with_intervals(
    fitter: Fitter, findings: Findings, explanation: Explanation
) -> tuple[Findings, Explanation]:
    """Return both with covariances for the kept model and the effects beside it.

    `fitter` works on the recording's own cells.
    """
    also = {*explanation.inseparable, *explanation.close}
    singles = [
        with_covariance(fitter, fit) if fit.members[0].effect in also else fit
        for fit in findings.singles
    ]
    model = with_covariance(fitter, explanation.model)
    return replace(findings, singles=singles), replace(explanation, model=model)


def with_covariance(fitter: Fitter, fit: Fit) -> Fit:
    """Return `fit` with the covariance C + diag(d^2) of its scaled parameters.

    C comes from the residuals. d is the difference of the parameters on the judging cells and on
    the coarser cells of `fitter`.
    """
    if not fit.members:
        return fit
    refined = fitter.with_covariance(fit)
    again = fitter.fit(fit.members, start=fit.scaled_parameters, coarse_steps=0, fine_steps=1)
    shift = again.scaled_parameters - fit.scaled_parameters
    return replace(fit, covariance=refined.covariance + np.diag(shift**2))
