"""Numerical diffusion as a cause of the gap: the configured scheme compared with a sharper one.

A scheme that smears fronts looks like dispersion. The accurate scheme on finer cells shows its part
of the gap, and a fitted diffusion shows its size.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.misfit import misfit
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.verdict import NUMERICAL
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.search.levels import JUDGING
from porotwin_diagnosis.search.ranking import overall_misfit, score
from porotwin_diagnosis.thresholds import NO_GAP_MISFIT, SHARPER_SCHEME_GAIN

ACCURATE = 'accurate'
"""The preset that the diagnosis itself uses; its numerical diffusion is taken as zero."""

EXPONENTS = (-1.5, 3.0)
"""Range of log10(D T / dx^2) that is searched for the equivalent diffusion D, with the duration T
of the recording and the width dx of a cell: fronts smeared over 0.2 to 30 cells."""

EXPONENT_TOLERANCE, MOST_RUNS = 0.05, 14
"""Accuracy of that logarithm (12 % of D) and the number of simulations that it may take."""


@dataclass(frozen=True)
class Numerics:
    """Normalised misfits [-] of the configured and of the accurate scheme.

    Attributes:
        preset: preset of the solver whose gap is diagnosed.
        configured: misfit of the configured scheme without effects.
        sharp: misfit of the accurate scheme without effects.
        with_effects: misfit of the configured scheme with the kept effects; None if not needed.
        model_diffusion: diffusion [m2/s] that makes the accurate scheme predict the same as the
            configured one; 0 where it was not needed.
    """

    preset: str
    configured: float
    sharp: float
    with_effects: float | None = None
    model_diffusion: float = 0.0

    @property
    def smears(self) -> bool:
        """Whether numerical diffusion makes a considerable part of the gap."""
        return (
            self.preset != ACCURATE
            and self.configured >= NO_GAP_MISFIT
            and self.sharp <= SHARPER_SCHEME_GAIN * self.configured
        )

    @property
    def leads(self) -> bool:
        """Whether the accurate scheme alone closes more of the gap than the effects alone."""
        return self.with_effects is not None and self.sharp < self.with_effects


def measure_numerics(samples: Sequence[Sample], null: Fit, model: Fit, *, preset: str) -> Numerics:
    """Return how much of the gap at `preset` is numerical diffusion.

    `null` is the model without effects, judged with the accurate scheme. `model` is the kept model.
    The function makes only the simulations that the answer needs.

    Raises:
        InputError: the model cannot run with the effects of `model`.
    """
    sharp = score(null)
    if preset == ACCURATE:
        return Numerics(preset, sharp, sharp)
    numerics = Numerics(preset, _misfit(samples, (), preset), sharp)
    if not numerics.smears:
        return numerics
    return Numerics(
        preset,
        numerics.configured,
        sharp,
        with_effects=_misfit(samples, model.effects, preset) if model.members else None,
        model_diffusion=_equivalent_diffusion(samples[0], preset),
    )


def _misfit(samples: Sequence[Sample], effects: Sequence[EffectDescription], preset: str) -> float:
    """Return the misfit of the scheme `preset` with `effects`."""
    residuals = [
        sample.whitened(Forward(sample, preset=preset).maps(effects), point_spread_width=0.0)
        for sample in samples
    ]
    return overall_misfit(*misfit(samples, residuals))


def before_and_after(
    sample: Sample, model: Fit, numerics: Numerics, crew: Executor | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the predicted maps of `sample` before and after the gap is closed, (nt, nz, nx) each.

    Before: the configured scheme without effects. After: the accurate scheme with the effects of
    `model`. Both are the same if neither effects nor numerical diffusion were found.
    """
    accurate = Forward(sample, preset=ACCURATE, crew=crew)
    after = np.clip(accurate.maps(model.effects), 0.0, 1.0)
    if numerics.preset == ACCURATE:
        return accurate.maps(()), after
    before = Forward(sample, preset=numerics.preset, crew=crew).maps(())
    return before, after if model.members or numerics.smears else before


def _equivalent_diffusion(sample: Sample, preset: str) -> float:
    """Return the diffusion [m2/s] that makes the accurate scheme predict the same as `preset`."""
    wanted = Forward(sample, preset=preset).maps(())
    sharp = Forward(sample, refinement=JUDGING)
    unit = sample.grid.dx**2 / sample.duration

    def difference(exponent: float) -> float:
        effect = EffectDescription(
            name=NUMERICAL, parameters={'model_diffusion': unit * 10.0**exponent}
        )
        return float(np.mean((sharp.maps((effect,)) - wanted) ** 2))

    found = minimize_scalar(
        difference,
        bounds=EXPONENTS,
        method='bounded',
        options={'xatol': EXPONENT_TOLERANCE, 'maxiter': MOST_RUNS},
    )
    return float(unit * 10.0**found.x)
