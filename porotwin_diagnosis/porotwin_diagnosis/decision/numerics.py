"""The model's own smearing as a gap: the same run with a sharp scheme on finer cells shows it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from porotwin_core.grid import FloatArray
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.misfit import misfit
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.verdict import NONE, NUMERICAL, UNEXPLAINED, Verdict
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import JUDGING
from porotwin_diagnosis.search.ranking import overall_misfit, score

WORTH = 0.75
"""The sharper scheme must bring the misfit below this share of the configured one's."""

LEAST_MISFIT = 1.5
"""Misfit of the configured scheme below which its smearing does not matter."""


@dataclass(frozen=True)
class Numerics:
    """What the configured scheme costs: misfit with it and with the sharp one, both without effect.

    `model_diffusion` [m2/s] is the diffusion that makes the sharp scheme like the configured one,
    zero where it was not needed; `found` whether the verdict names it, `leads` whether the sharp
    scheme alone closes more than the verdict's effects alone.
    """

    preset: str
    configured: float
    sharp: float
    model_diffusion: float = 0.0
    found: bool = False
    leads: bool = False

    def amended(self, verdict: Verdict) -> Verdict:
        """Return `verdict` with the model's smearing in it, where that is what closes the gap."""
        if not self.found or verdict.name == UNEXPLAINED:
            return verdict
        if verdict.name == NONE:
            return replace(verdict, name=NUMERICAL, members=(NUMERICAL,))
        if not self.leads:
            return replace(verdict, members=(*verdict.members, NUMERICAL))
        alike = [(name, *verdict.members[1:]) for name in verdict.inseparable]
        return replace(
            verdict,
            name=NUMERICAL,
            members=(NUMERICAL, *verdict.members),
            inseparable=(),
            alternatives=tuple((NUMERICAL, *names) for names in verdict.alternatives or alike),
        )


def judge_numerics(
    samples: Sequence[Sample], findings: Findings, verdict: Verdict, *, preset: str
) -> Numerics:
    """Return how much of the gap of the model at `preset` is its own smearing, beside the effects
    that `verdict` names."""
    sharp = score(findings.null)
    if preset == 'accurate':
        return Numerics(preset, sharp, sharp)
    configured = _misfit(samples, (), preset)
    if configured < LEAST_MISFIT or sharp > WORTH * configured:
        return Numerics(preset, configured, sharp)
    diffusion = _equivalent_diffusion(samples[0], preset)
    effects = verdict.model.effects
    leads = bool(verdict.members) and sharp < _misfit(samples, effects, preset)
    return Numerics(preset, configured, sharp, diffusion, found=True, leads=leads)


def _misfit(samples: Sequence[Sample], effects: Sequence[EffectDescription], preset: str) -> float:
    """Return the misfit of the model at `preset` with `effects`."""
    residuals = [
        sample.whitened(Forward(sample, preset=preset).maps(effects), point_spread_width=0.0)
        for sample in samples
    ]
    return overall_misfit(*misfit(samples, residuals))


def before_and_after(
    sample: Sample, model: Fit, numerics: Numerics
) -> tuple[FloatArray, FloatArray]:
    """Return the maps (nt, nz, nx) of `sample` by the configured model and by the mended one.

    The mended one is sharp; where nothing was mended, both are the configured one.
    """
    sharp = Forward(sample, preset='accurate')
    after = np.clip(sharp.maps(model.effects), 0.0, 1.0)
    if numerics.preset == 'accurate':
        return sharp.maps(()), after
    before = Forward(sample, preset=numerics.preset).maps(())
    return before, after if model.members or numerics.found else before


def _equivalent_diffusion(sample: Sample, preset: str) -> float:
    """Return the diffusion [m2/s] with which the sharp scheme predicts what `preset` does."""
    wanted = Forward(sample, preset=preset).maps(())
    sharp = Forward(sample, refinement=JUDGING)
    unit = sample.grid.dx**2 / sample.duration

    def difference(exponent: float) -> float:
        effect = EffectDescription(
            name=NUMERICAL, parameters={'model_diffusion': unit * 10.0**exponent}
        )
        return float(np.mean((sharp.maps((effect,)) - wanted) ** 2))

    found = minimize_scalar(
        difference, bounds=(-1.5, 3.0), method='bounded', options={'xatol': 0.05, 'maxiter': 14}
    )
    return float(unit * 10.0**found.x)
