"""Which next experiment would tell more: schedules tried on the two best explanations.

Each is simulated as if the first explanation were true; then the second is fitted to it together
with the present recording, where it imitates the first as well as it can. What it cannot imitate is
what the experiment would tell.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, Sample
from porotwin_diagnosis.decision.verdict import Verdict, thresholds
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.progress import Progress
from porotwin_diagnosis.report.wording import CHECKS, spoken
from porotwin_diagnosis.search.findings import Findings

STEPS = 2
"""Iterations in which the second explanation is fitted to the first."""

LEAST_GAIN = 1.1
"""Gain from which an experiment is worth proposing."""


@dataclass(frozen=True)
class Proposal:
    """An experiment and what it is for.

    `gain` is how many times further apart this recording and the experiment together would set the
    two best explanations than if this recording were made again, or than they must lie to be told
    apart, where they do not; None where only the laboratory can tell.
    """

    name: str
    what: str
    separates: tuple[str, str]
    gain: float | None = None


def propose(
    fitter: Fitter,
    findings: Findings,
    verdict: Verdict,
    *,
    progress: Progress = lambda _stage, _share: None,
) -> tuple[Proposal, ...]:
    """Return experiments that would separate the two best explanations, the most telling first.

    Of several recordings that is varied which sets the two furthest apart. What would tell no more
    than the same again is not proposed; without a gap there is nothing to separate.
    """
    rivals = _rivals(findings, verdict)
    if rivals is None:
        return ()
    one, other = rivals
    names = (one.label, other.label)
    try:
        present, sample = max(
            ((_apart([sample], one, other), sample) for sample in fitter.samples),
            key=lambda item: item[0],
        )
    except InputError:  # the model cannot run with the other one in all of them
        return tuple(_laboratory(names, one, other))
    tried = []
    again = np.sqrt(2.0) * max(present, thresholds().same * np.sqrt(sample.tracer_cells))
    for number, (name, what, change) in enumerate(SCHEDULES):
        progress(f'trying an experiment: {name}', 0.96 + 0.02 * number / len(SCHEDULES))
        changed = change(sample)
        if changed is None:
            continue
        try:
            gain = float(_apart([sample, changed], one, other) / again)
        except InputError:  # the model cannot run with such rates
            continue
        if gain > LEAST_GAIN:
            tried.append(Proposal(name, what, names, gain))
    tried.sort(key=lambda proposal: -(proposal.gain or 0.0))
    return (*_laboratory(names, one, other), *tried)


def _rivals(findings: Findings, verdict: Verdict) -> tuple[Fit, Fit] | None:
    """Return the model that was kept and the best other one, before all what shows the same."""
    kept = verdict.model
    if not kept.members:
        return None
    fits = findings.pairs if len(kept.members) > 1 else findings.singles
    others = [fit for fit in fits if fit.label != kept.label] or [
        fit for fit in findings.singles if fit.label != kept.label
    ]
    if not others:
        return None
    alike = {(name,) for name in verdict.inseparable} | set(verdict.alternatives)
    others.sort(key=lambda fit: tuple(member.effect for member in fit.members) not in alike)
    return kept, others[0]


def _apart(samples: list[Sample], one: Fit, other: Fit) -> float:
    """Return the whitened distance that `other` keeps when fitted to what `one` would show."""
    shown = Fitter([Forward(_as_shown(sample, one)) for sample in samples])
    best = shown.fit(other.members, start=other.scaled_parameters, coarse_steps=0, fine_steps=STEPS)
    residuals = shown.residuals(best.effects, SMOOTHING_WIDTH)
    return float(np.sqrt(sum(np.sum(residual**2) for residual in residuals)))


def _as_shown(sample: Sample, one: Fit) -> Sample:
    """Return `sample` as the camera would show it without noise if `one` were true, all fitted."""
    maps = np.clip(Forward(sample).maps(one.effects), 0.0, 1.0)
    return replace(sample, observed=sample.noise.expected(maps), fitted_frames=len(sample.times))


def _laboratory(names: tuple[str, str], one: Fit, other: Fit) -> list[Proposal]:
    """Return what measures by itself an effect that only one of the two holds."""
    sides = [{member.label: member.effect for member in fit.members} for fit in (one, other)]
    apart = sides[0].keys() ^ sides[1].keys()
    effects = dict.fromkeys(
        effect for side in sides for label, effect in side.items() if label in apart
    )
    return [Proposal(f'check {spoken(effect)}', CHECKS[effect], names) for effect in effects]


def _with(sample: Sample, rows: list[ScheduleRow]) -> Sample:
    return replace(sample, schedule=Schedule(tuple(rows)))


def _scaled(factor: float) -> Callable[[Sample], Sample]:
    """Return a change that pumps `factor` times as fast, in so much less time."""

    def change(sample: Sample) -> Sample:
        rows = [
            ScheduleRow(
                row.time / factor,
                row.well,
                WellRate(row.rate.rate * factor, row.rate.concentration),
            )
            for row in sample.schedule.rows
        ]
        return replace(
            _with(sample, rows),
            times=sample.times / factor,
            start=sample.start / factor,
            held_out_start=sample.held_out_start / factor,
            end=sample.end / factor,
        )

    return change


def _rest(sample: Sample) -> Sample:
    stop = sample.start + 0.4 * sample.duration
    rows = [row for row in sample.schedule.rows if row.time < stop]
    rows += [ScheduleRow(stop, well, WellRate()) for well in sample.schedule.wells]
    return _with(sample, rows)


def _chase(sample: Sample) -> Sample:
    turn = sample.start + 0.5 * sample.duration
    rows = [
        ScheduleRow(row.time, row.well, WellRate(row.rate.rate, 0.0)) if row.time >= turn else row
        for row in sample.schedule.rows
    ]
    for well, rate in sample.schedule.at(turn).items():
        if rate.rate > 0:
            rows.append(ScheduleRow(turn, well, WellRate(rate.rate, 0.0)))
    return _with(sample, rows)


def _one_at_a_time(sample: Sample) -> Sample | None:
    """Return every pumping well alone in turn, those with tracer first; None if there is but one.

    A well pumps the most it was told; if only one does, water follows through the well next to it.
    In a closed rig injectors take turns, and the producers take out as much as goes in.
    """
    most: dict[str, WellRate] = {}
    for row in sample.schedule.rows:
        if abs(row.rate.rate) > abs(most.get(row.well, WellRate()).rate):
            most[row.well] = row.rate
    closed = sample.rig.closed
    producing = {well: rate.rate for well, rate in most.items() if rate.rate < 0}
    turns = [(well, rate) for well, rate in most.items() if rate.rate > 0 or not closed]
    if len(turns) == 1 and not closed and len(sample.rig.wells) > 1:
        turns.append((_next_well(sample, turns[0][0]), WellRate(abs(turns[0][1].rate))))
    if len(turns) < 2 or (closed and not producing):
        return None
    turns.sort(key=lambda item: (-item[1].concentration, -item[1].rate))
    rows = []
    for number, (well, rate) in enumerate(turns):
        told = dict.fromkeys([*most, *dict(turns)], WellRate()) | {well: rate}
        if closed:
            share = rate.rate / sum(producing.values())
            told |= {name: WellRate(-share * out) for name, out in producing.items()}
        begin = sample.start + sample.duration * number / len(turns)
        rows += [ScheduleRow(begin, name, value) for name, value in told.items()]
    return _with(sample, rows)


def _next_well(sample: Sample, name: str) -> str:
    """Return the well next to `name`."""
    wells = sample.rig.wells
    here = wells[name]
    others = [other for other in wells if other != name]
    return min(
        others, key=lambda other: np.hypot(wells[other].x_m - here.x_m, wells[other].z_m - here.z_m)
    )


SCHEDULES: tuple[tuple[str, str, Callable[[Sample], Sample | None]], ...] = (
    (
        'rest',
        'stop all pumps after 40 % of the time and go on photographing: diffusion, buoyancy and '
        'decay go on, dispersion and wrong rates stop',
        _rest,
    ),
    ('half rates', 'the same volumes at half the rates, in twice the time', _scaled(0.5)),
    ('double rates', 'the same volumes at twice the rates, in half the time', _scaled(2.0)),
    ('chase', 'inject water without tracer in the second half', _chase),
    (
        'one well at a time',
        'let every pump run alone in turn, those with tracer first (a single one is followed by '
        'water through the well next to it): what is wrong with one well shows in its turn only, '
        'what is wrong with the sand in every turn',
        _one_at_a_time,
    ),
)
"""Schedules that are tried, made from that of the recording."""
