"""The bound on the noise that imaging states: what the best fit leaves.

Imaging states the random deviation of each cell with care, and smoothing damps it more than the
diagnosis can know. On photographs of the virtual rig it is three to four times too large. Noise
that is stated too large hides gaps. But noise is in the remainder of every fit: a fit that leaves
less than the stated noise proves that the noise is smaller. The noise that counts is therefore

    max(measured noise, share * stated noise),    share = min(1, min over the parts of m / n)

with the misfit m of the best fit and its stated noise n. Measured noise is never reduced, and
recordings without stated deviations have only this.
"""

from collections.abc import Sequence
from dataclasses import replace

from porotwin_diagnosis.model.fit import Fit, with_noise_share
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.ranking import ranked

LEAST_NOISE = 1e-9
"""Least misfit from noise [-], so that divisions stay finite."""


def noise_share(fits: Sequence[Fit]) -> float:
    """Return the share [-] of the stated noise that the best of the judged `fits` allows."""
    best = ranked([fit for fit in fits if fit.is_feasible])[0]
    misfits = (best.fitted_misfit, best.held_out_misfit)
    shares = (
        misfit / max(noise, LEAST_NOISE)
        for misfit, noise in zip(misfits, best.stated_noise, strict=True)
    )
    return min(1.0, *shares)


def with_measured_noise(fit: Fit) -> Fit:
    """Return `fit` with the noise that the maps themselves show, and no other."""
    return with_noise_share(fit, 0.0)


def with_bounded_levels(levels: Levels, fits: Sequence[Fit]) -> Levels:
    """Return levels that judge with no more noise than the best of the judged `fits` leaves."""
    share = min(noise_share(fits), levels.judging.noise_share)
    return replace(levels, judging=replace(levels.judging, noise_share=share))


def with_bounded_findings(levels: Levels, findings: Findings) -> Findings:
    """Return `findings` whose judged fits have no more noise than `levels` allow."""
    share = levels.judging.noise_share

    def bounded(fits: Sequence[Fit]) -> list[Fit]:
        return [with_noise_share(fit, share) for fit in fits]

    return replace(
        findings,
        null=with_noise_share(findings.null, share),
        singles=bounded(findings.singles),
        pairs=bounded(findings.pairs),
        triples=bounded(findings.triples),
    )
