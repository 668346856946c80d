"""The least certain point of a verdict, in words."""

from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED, Doubt, Verdict
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.report.wording import spoken
from porotwin_diagnosis.thresholds import SCANT_CELLS, SCANT_FRAMES

ALWAYS_SAID = {Doubt.SCANT}
"""Doubts that the report explains with figures of their own."""


def doubt_words(result: Diagnosis) -> str:
    """Return the point of the verdict on `result` that sets its confidence, as a clause."""
    verdict = result.verdict
    lack = result.evidence.explanation.lack_of_fit
    return {
        Doubt.NO_GAP: 'how far the error is from the limit above which it would be a gap',
        Doubt.CALIBRATION: 'whether errors of the calibration, which all maps share, hide a gap'
        if verdict.name == NONE
        else 'whether errors of the calibration, which all maps share, make the gap instead',
        Doubt.RIVAL: _rival(verdict),
        Doubt.REMAINDER: _remainder(verdict.name, lack),
        Doubt.FEWER: 'whether fewer effects are enough',
        Doubt.START: 'whether the clock is late: while one rate goes on, tracer that the rig held '
        'before the recording makes the same maps. Compare the clocks of camera and pumps, or '
        'change a rate in the next recording',
        Doubt.SCANT: scant(result.evidence),
        Doubt.UNTRIED: f'what the search did not try: {result.evidence.findings.untried}',
    }[verdict.doubt]


def scant(evidence: Evidence) -> str:
    """Say why the confidence is not higher, and name a remedy."""
    parts = []
    if evidence.cells_along < SCANT_CELLS:
        parts.append(
            f'maps of {evidence.cells_along} cells along the longer side of the rig are coarser '
            f'than the {SCANT_CELLS} that the rules need; make finer maps'
        )
    if evidence.fitted_frames < SCANT_FRAMES:
        parts.append(
            f'{evidence.fitted_frames} maps with tracer in the first 70 % are fewer than '
            f'{SCANT_FRAMES}; photograph more often'
        )
    return ', and '.join(parts)


def _rival(verdict: Verdict) -> str:
    """Say which other explanation comes next."""
    if verdict.rival == (NONE,):
        return 'whether there is a gap at all'
    if not verdict.rival:
        return 'whether another effect explains the recording better'
    names = ' and '.join(map(spoken, verdict.rival))
    return f'whether the cause is {names} instead, the next best explanation'


def _remainder(name: str, lack: float) -> str:
    """Say how much of the misfit that a true effect may leave the best model leaves."""
    if name == UNEXPLAINED:
        return (
            f'the best model leaves {lack:.1f} times as much as a true effect may leave; below 1 '
            'it would be the answer'
        )
    return (
        'whether another cause, which the library does not have, looks like this effect. The error '
        f'that remains is {100 * lack:.0f} % of what a true effect may leave. The lower this '
        'number, the surer the effect'
    )
