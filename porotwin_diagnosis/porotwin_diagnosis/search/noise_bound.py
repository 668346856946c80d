"""The bound on the noise: the remainder of the best fit.

Noise that is estimated too large hides gaps: imaging states the deviation of single cells, and
smoothing damps it by a factor that differs from photograph to photograph; rings of many pulses look
like grain. But noise is in the remainder of every fit. A fit that leaves less than the noise proves
that the noise is smaller. With the misfit m of the best fit and its expected noise n, the noise of
every fit is b n with

    b = min(1, `NOISE_UNCERTAINTY` m / n)

in the part, fitted or held out, where this is smaller.
"""

from collections.abc import Sequence
from dataclasses import replace

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_diagnosis.model.fit import Fit, with_noise_share
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.ranking import ranked
from porotwin_diagnosis.thresholds import NOISE_UNCERTAINTY


def noise_share(fits: Sequence[Fit]) -> float:
    """Return the share of the expected noise that the best of the judged `fits` allows."""
    best = ranked([fit for fit in fits if fit.is_feasible])[0]
    misfits = (best.fitted_misfit, best.held_out_misfit)
    parts = zip(misfits, best.expected_noise, strict=True)
    return min(1.0, *(NOISE_UNCERTAINTY * misfit / max(n, SMALLEST_DIVISOR) for misfit, n in parts))


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
