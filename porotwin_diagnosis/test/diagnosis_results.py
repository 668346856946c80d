"""A diagnosis that tests share: its fits are evaluated at given parameters, nothing is searched."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from porotwin_core.rig import EffectDescription, Rig
from porotwin_diagnosis.advice.strength import Strength
from porotwin_diagnosis.data.sample import Sample, read_sample
from porotwin_diagnosis.decision.evidence import gather
from porotwin_diagnosis.decision.explanation import Explanation
from porotwin_diagnosis.decision.held_out import HeldOut
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.gap_map import map_gap
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.search.findings import Findings
from porotwin_recording.experiment.recording import Recording, open_recording


def diagnosis_of_denser_sand(path: Path) -> Diagnosis:
    """Return the diagnosis of a recording with a porosity 12 % lower than the nominal one."""
    recording = open_recording(path)
    sample = read_sample(recording)
    candidates = {candidate.effect: candidate for candidate in library([sample])}
    fitter = Fitter([Forward(sample)])
    porosity, rate = candidates['porosity'], candidates['rate']
    found = np.array([porosity.parameters[0].scaled(0.88)])
    null = fitter.evaluate((), np.zeros(0))
    best = replace(fitter.evaluate((porosity,), found), covariance=np.array([[0.04]]))
    other = fitter.evaluate((rate,), np.array([1.0]))
    pair = fitter.evaluate((porosity, rate), np.array([found[0], 0.5]))
    singles = [best, other]
    findings = Findings(null, null, singles, singles, [pair], [0.0, 3.0], runs=4)
    held_out = held_out_part(recording, sample, best)
    numerics = Numerics('accurate', null.held_out_misfit, null.held_out_misfit)
    explanation = Explanation(best, 0.5, ('porosity',))
    return Diagnosis(
        recordings=(recording,),
        samples=(sample,),
        evidence=gather([sample], findings, explanation, numerics),
        verdict=Verdict('porosity', 0.9, best, ('porosity',), (), {'porosity': 0.98, 'rate': 0.02}),
        held_out=(held_out,),
        gap=map_gap(recording),
        strengths={'porosity': Strength('factor', 0.0097, '-')},
        proposals=(),
        seconds=0.0,
    )


def held_out_part(recording: Recording, sample: Sample, model: Fit) -> HeldOut:
    """Return the held-out part without and with `model`, by the fast preset, without blur."""
    late = recording.times >= sample.held_out_start
    observed = recording.concentration[late].astype(float)
    part = replace(sample, times=recording.times[late], observed=observed, fitted_frames=0)
    before = Forward(part).maps(())
    after = Forward(part).maps(model.effects)
    errors = (part.relative_error(before), part.relative_error(after))
    return HeldOut(part.times, observed, before, after, *errors, 0.03, 0.0)


def on_rig(result: Diagnosis, rig: Rig) -> Diagnosis:
    """Return `result` as if its recording described `rig`."""
    return replace(result, recordings=(replace(result.recordings[0], rig=rig),))


def with_effects(result: Diagnosis, *effects: EffectDescription) -> Diagnosis:
    """Return `result` as if rig.yaml described `effects`."""
    return on_rig(result, result.recordings[0].rig.with_effects(effects))


def no_gap(result: Diagnosis) -> Diagnosis:
    """Return `result` with the verdict that there is no gap."""
    verdict = Verdict('none', 0.9, result.evidence.findings.null, (), (), {'porosity': 0.1})
    return replace(result, verdict=verdict)


def twice(result: Diagnosis) -> Diagnosis:
    """Return `result` as a diagnosis of two equal recordings."""
    return replace(
        result,
        recordings=result.recordings * 2,
        samples=result.samples * 2,
        held_out=result.held_out * 2,
        gap=replace(result.gap, each=result.gap.each * 2),
    )


def naming(result: Diagnosis, name: str, parameters: dict[str, float]) -> Diagnosis:
    """Return `result` with a verdict for an effect at given parameters, by name."""
    sample = result.samples[0]
    candidate = next(c for c in library([sample]) if c.effect == name)
    scaled = np.array([p.scaled(parameters.get(p.name, p.neutral)) for p in candidate.parameters])
    size = len(scaled)
    fit = Fit((candidate,), scaled, 0.5, 0.5, 0.1, 0.1, 0.01 * np.eye(size))
    findings = replace(result.evidence.findings, singles=[fit, *result.evidence.findings.singles])
    evidence = replace(result.evidence, findings=findings)
    verdict = Verdict(name, 0.9, fit, (name,), (), {name: 0.9})
    return replace(result, evidence=evidence, verdict=verdict)
