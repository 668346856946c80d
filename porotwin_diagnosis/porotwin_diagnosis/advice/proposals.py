"""Proposes the next experiments.

A named cause is compared with the best other explanation. Each changed schedule is simulated as if
the first explanation were true. The second explanation is then fitted to this simulation and to the
present recording together: it imitates the first one as well as it can. The remaining distance
between both is the information in the experiment.

An unexplained gap gets the checks of its form, and experiments that tell kinds of causes apart.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_diagnosis.advice.remainder_form import RemainderForm
from porotwin_diagnosis.advice.schedule_changes import SCHEDULE_CHANGES
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, Sample
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.progress import Progress, no_progress
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.thresholds import INDISTINGUISHABLE, LEAST_EXPERIMENT_GAIN
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.effect import Process

IMITATION_STEPS = 2
"""Iterations of the fit of the second explanation to the first. The fit starts at its best
parameters for the present recording, and two steps bring it close to its best imitation."""

TELLING_KINDS: dict[str, tuple[str | None, ...]] = {
    'rest': ('source', 'transport', 'storage', 'camera', None),
    'one well at a time': ('source', 'transport', None),
}
"""Experiments that show whether an unknown cause is of the described kind (None: no description):
at rest the camera, storage, flows from outside, diffusion and buoyancy go on, dispersion and wrong
rates stop; a wrong pump shows in its turn alone, the sand in every turn."""

WATER_LEVEL = (
    'mark the water level at every open side and look at it again at the end: a level that rises, '
    'falls or is tilted drives a flow that the model does not have'
)
"""How to check the water level. It holds for every rig with an open side, whatever the form."""

SAME_AGAIN = np.sqrt(2.0)
"""Factor between the distance of two explanations in one recording and in two equal ones."""


@dataclass(frozen=True)
class Proposal:
    """An experiment, or a check in the laboratory.

    Attributes:
        name: a short name.
        separates: labels of the explanations that it separates.
        description: instructions.
        gain: distance of the explanations with this experiment over their distance in a repetition
            of the recording (or over the least distinguishable distance, if larger). None for a
            check in the laboratory, which decides by itself, and for an unexplained gap.
    """

    name: str
    separates: tuple[str, ...]
    description: str
    gain: float | None = None


def propose(
    fitter: Fitter,
    findings: Findings,
    verdict: Verdict,
    *,
    progress: Progress = no_progress,
) -> tuple[Proposal, ...]:
    """Return experiments that separate the two best explanations, the most informative first.

    Checks in the laboratory come first. The schedule of the recording with the largest difference
    between the explanations is varied. An experiment is proposed if its gain is above
    `LEAST_EXPERIMENT_GAIN`. Without a gap there is nothing to separate, and the result is empty.
    The same holds if the named effect stands alone.
    """
    best = _two_best(findings, verdict)
    if best is None:
        return ()
    one, other = best
    names = (one.label, other.label)
    checks = tuple(_laboratory_checks(names, one, other))
    try:
        present, sample = max(
            ((_distance([sample], one, other), sample) for sample in fitter.samples),
            key=lambda item: item[0],
        )
    except InputError:  # the model cannot run one explanation with the other's recording
        return checks
    distinguishable = INDISTINGUISHABLE * np.sqrt(sample.tracer_cells)
    again = SAME_AGAIN * max(present, distinguishable)
    tried = []
    for number, change in enumerate(SCHEDULE_CHANGES):
        progress(
            f'trying an experiment: {change.name}', 0.96 + 0.02 * number / len(SCHEDULE_CHANGES)
        )
        changed = change.apply(sample)
        if changed is None:
            continue
        try:
            gain = float(_distance([sample, changed], one, other) / again)
        except InputError:  # the model cannot run with such rates
            continue
        if gain > LEAST_EXPERIMENT_GAIN:
            tried.append(Proposal(change.name, names, change.description, gain=gain))
    tried.sort(key=lambda proposal: -(proposal.gain or 0.0))
    return (*checks, *tried)


def _two_best(findings: Findings, verdict: Verdict) -> tuple[Fit, Fit] | None:
    """Return the kept model and the best other one; None if there is nothing to separate.

    Effects that are nearly as good come first: an experiment can separate them. Effects that look
    the same follow, then the most probable other ones, as the table of the report ranks them.
    """
    kept = verdict.model
    if not kept.members or verdict.stands_alone:
        return None
    fits = findings.pairs if len(kept.members) > 1 else ()
    others = [fit for fit in fits if fit.label != kept.label] or _other_singles(findings, kept)
    if not others:
        return None
    close = {(name,) for name in verdict.close}
    same = {(name,) for name in verdict.inseparable} | set(verdict.alternatives)
    own = tuple(member.effect for member in kept.members)

    def urgency(fit: Fit) -> tuple[bool, bool, bool, bool, float]:
        names = tuple(member.effect for member in fit.members)
        share = verdict.probabilities.get(names[0], 0.0) if len(names) == 1 else 0.0
        return names not in close, names not in same, names != verdict.rival, names == own, -share

    return kept, min(others, key=urgency)


def _other_singles(findings: Findings, kept: Fit) -> list[Fit]:
    """Return the fits of single effects beside `kept`, the best first.

    Most effects are fitted on coarse cells only. One of them may still be the most probable rival.
    """
    fits = (fit for fit in (*findings.singles, *findings.screened) if fit.members)
    return [fit for fit in fits if fit.label != kept.label]


def _distance(samples: list[Sample], one: Fit, other: Fit) -> float:
    """Return the whitened distance that remains when `other` is fitted to the maps of `one`."""
    fitter = Fitter([Forward(_simulated(sample, one)) for sample in samples])
    best = fitter.fit(
        other.members, start=other.scaled_parameters, coarse_steps=0, fine_steps=IMITATION_STEPS
    )
    residuals = fitter.residuals(best.effects, SMOOTHING_WIDTH)
    return float(np.sqrt(sum(np.sum(residual**2) for residual in residuals)))


def _simulated(sample: Sample, one: Fit) -> Sample:
    """Return `sample` with the expected maps of `one` as its observed maps, all of them fitted."""
    maps = np.clip(Forward(sample).maps(one.effects), 0.0, 1.0)
    return replace(
        sample,
        observed=sample.noise.expected(maps),
        fitted_frames=len(sample.times),
        own_deviation=None,
    )


def _laboratory_checks(names: tuple[str, str], one: Fit, other: Fit) -> Iterator[Proposal]:
    """Yield a check for every effect that only one of the two explanations contains."""
    sides = [{member.label: member.effect for member in fit.members} for fit in (one, other)]
    different = sides[0].keys() ^ sides[1].keys()
    effects = dict.fromkeys(
        effect for side in sides for label, effect in side.items() if label in different
    )
    for effect in effects:
        check = EFFECTS[effect].laboratory_check
        yield Proposal(f'check {effect.replace("_", " ")}', names, check)


def checks_of_form(form: RemainderForm, rig: Rig) -> Iterator[tuple[str, str]]:
    """Yield a name and a check for every term of `form`; first the water level of an open side."""
    if not rig.closed:
        yield 'water level', WATER_LEVEL
    for term in form.terms:
        yield term.name, term.check


def tell_kinds_apart(form: RemainderForm, sample: Sample) -> tuple[Proposal, ...]:
    """Return the checks of the `form` of an unexplained gap, and experiments that show its kind."""
    named = checks_of_form(form, sample.rig)
    checks = (Proposal(f'check: {name}', (name,), check) for name, check in named)
    kinds = tuple(process.value for process in Process)
    experiments = (
        Proposal(change.name, kinds, change.description)
        for change in SCHEDULE_CHANGES
        if form.kind in TELLING_KINDS.get(change.name, ()) and change.apply(sample) is not None
    )
    return (*checks, *experiments)
