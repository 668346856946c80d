"""The bound on the noise: what the best fit leaves.

Noise that is estimated too large hides gaps. Imaging states the random deviation of each cell with
care, and smoothing damps it more than the diagnosis can know: on photographs of the virtual rig it
is three to four times too large. The noise that is measured in the maps may be too large as well:
rings of many pulses look like grain. But noise is in the remainder of every fit. A fit that leaves
less than the noise proves that the noise is smaller. With the misfit m of the best fit, its stated
noise n and its measured noise w, the noise of every fit is

    max(b w, a n),    a = min(1, m / n),    b = min(1, `NOISE_UNCERTAINTY` m / w),

the smaller share of both parts in each case. Measured noise has a tolerance, because it is an
estimate, where the stated one is only a limit.
"""

from collections.abc import Sequence
from dataclasses import replace

from porotwin_diagnosis.model.fit import Fit, NoiseBound, with_noise_bound
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.ranking import ranked
from porotwin_diagnosis.thresholds import NOISE_UNCERTAINTY

LEAST_NOISE = 1e-9
"""Least misfit from noise [-], so that divisions stay finite."""


def noise_bound(fits: Sequence[Fit]) -> NoiseBound:
    """Return the shares of the noise that the best of the judged `fits` allows."""
    best = ranked([fit for fit in fits if fit.is_feasible])[0]
    misfits = (best.fitted_misfit, best.held_out_misfit)

    def share(noises: tuple[float, float], tolerance: float) -> float:
        pairs = zip(misfits, noises, strict=True)
        return min(1.0, *(tolerance * misfit / max(noise, LEAST_NOISE) for misfit, noise in pairs))

    return NoiseBound(share(best.stated_noise, 1.0), share(best.measured_noise, NOISE_UNCERTAINTY))


def with_measured_noise(fit: Fit) -> Fit:
    """Return `fit` with the noise that the maps themselves show, and no other."""
    fitted, held_out = map(min, fit.noise_misfit, fit.measured_noise)
    return replace(fit, noise_misfit=(fitted, held_out))


def with_bounded_levels(levels: Levels, fits: Sequence[Fit]) -> Levels:
    """Return levels that judge with no more noise than the best of the judged `fits` leaves."""
    found, known = noise_bound(fits), levels.judging.noise_bound
    bound = NoiseBound(*map(min, found, known))
    return replace(levels, judging=replace(levels.judging, noise_bound=bound))


def with_bounded_findings(levels: Levels, findings: Findings) -> Findings:
    """Return `findings` whose judged fits have no more noise than `levels` allow."""
    bound = levels.judging.noise_bound

    def bounded(fits: Sequence[Fit]) -> list[Fit]:
        return [with_noise_bound(fit, bound) for fit in fits]

    return replace(
        findings,
        null=with_noise_bound(findings.null, bound),
        singles=bounded(findings.singles),
        pairs=bounded(findings.pairs),
        triples=bounded(findings.triples),
    )
