"""Which next experiment would tell more: schedules tried on the two best explanations."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.candidates import CAMERA
from porotwin_diagnosis.evidence import WIDTH, Sample
from porotwin_diagnosis.fit import Fit, Fitter
from porotwin_diagnosis.forward import Forward
from porotwin_diagnosis.search import Findings
from porotwin_diagnosis.verdict import Verdict


@dataclass(frozen=True)
class Proposal:
    """An experiment and what it is for; `gain` is how many times further apart it would set
    the two best explanations than this recording does, None where only the laboratory can tell."""

    name: str
    what: str
    separates: tuple[str, str]
    gain: float | None = None


def propose(fitter: Fitter, findings: Findings, verdict: Verdict) -> tuple[Proposal, ...]:
    """Return experiments that would separate the two best explanations, the most telling first."""
    one, other = _rivals(findings, verdict)
    if one is None or other is None:
        return ()
    sample = fitter.samples[0]
    names = (one.label, other.label)
    present = _apart(sample, one, other, sample.schedule)
    tried = [
        Proposal(name, what, names, _apart(sample, one, other, change(sample)) / present)
        for name, what, change in SCHEDULES
        if present > 0
    ]
    tried.sort(key=lambda proposal: -(proposal.gain or 0.0))
    if present < 1e-3:
        tried = []
    return (*_laboratory(names, one, other), *tried)


def _rivals(findings: Findings, verdict: Verdict) -> tuple[Fit | None, Fit | None]:
    fits = sorted(findings.singles, key=lambda fit: fit.members[0].effect not in verdict.members)
    if len(fits) < 2:
        return None, None
    return fits[0], fits[1]


def _apart(sample: Sample, one: Fit, other: Fit, schedule: Schedule) -> float:
    changed = replace(sample, schedule=schedule, weights={})
    forward = Forward(changed)
    residuals = [changed.whitened(forward.maps(fit.effects), width=WIDTH) for fit in (one, other)]
    return float(np.sqrt(np.mean((residuals[0] - residuals[1]) ** 2)))


def _laboratory(names: tuple[str, str], one: Fit, other: Fit) -> list[Proposal]:
    effects = {one.members[0].effect, other.members[0].effect}
    found = []
    if effects & set(CAMERA):
        found.append(
            Proposal(
                'grey card',
                'photograph a grey card and a scale in the tracer-free rig: it shows what the '
                'camera does by itself',
                names,
            )
        )
    if effects & {'rate', 'porosity', 'retardation', 'depth', 'leak'}:
        found.append(
            Proposal(
                'weighed outflow',
                'weigh what every pump delivers and what leaves the rig for ten minutes: it '
                'fixes the rates, and with them porosity and depth',
                names,
            )
        )
    if effects & {'retardation', 'porosity', 'dual_porosity', 'decay'}:
        found.append(
            Proposal(
                'water chase',
                'chase the tracer with water and sample the producer: sorbed or immobile tracer '
                'leaves a tail, a wrong porosity does not',
                names,
            )
        )
    return found


def _scaled(factor: float) -> Callable[[Sample], Schedule]:
    def change(sample: Sample) -> Schedule:
        return Schedule(
            tuple(
                ScheduleRow(
                    row.time / factor,
                    row.well,
                    WellRate(row.rate.rate * factor, row.rate.concentration),
                )
                for row in sample.schedule.rows
            )
        )

    return change


def _rest(sample: Sample) -> Schedule:
    stop = sample.start + 0.4 * sample.duration
    rows = [row for row in sample.schedule.rows if row.time < stop]
    rows += [ScheduleRow(stop, well, WellRate()) for well in sample.schedule.wells]
    return Schedule(tuple(rows))


def _chase(sample: Sample) -> Schedule:
    turn = sample.start + 0.5 * sample.duration
    rows = [
        ScheduleRow(row.time, row.well, WellRate(row.rate.rate, 0.0)) if row.time >= turn else row
        for row in sample.schedule.rows
    ]
    for well, rate in sample.schedule.at(turn).items():
        if rate.rate > 0:
            rows.append(ScheduleRow(turn, well, WellRate(rate.rate, 0.0)))
    return Schedule(tuple(rows))


SCHEDULES: tuple[tuple[str, str, Callable[[Sample], Schedule]], ...] = (
    (
        'rest',
        'stop all pumps after 40 % of the time and go on photographing: diffusion, buoyancy and '
        'decay go on, dispersion and wrong rates stop',
        _rest,
    ),
    ('half rates', 'the same volumes at half the rates', _scaled(0.5)),
    ('double rates', 'the same volumes at twice the rates', _scaled(2.0)),
    ('chase', 'inject water without tracer in the second half', _chase),
)
"""Schedules that are tried, made from that of the recording."""
