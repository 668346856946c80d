"""Recordings on cells of four sizes, and what a fit learns on the way from coarse to fine ones."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.optimize import minimize_scalar

from porotwin_core.grid import relative_error
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import Sample, coarsened
from porotwin_diagnosis.model.fit import Fit, Fitter
from porotwin_diagnosis.model.forward import Forward, on_rough_sand
from porotwin_diagnosis.model.library import pumping_wells
from porotwin_diagnosis.progress import Progress
from porotwin_diagnosis.search.ranking import (
    NEARLY_CLOSED,
    near,
    normalised_misfit,
    possible,
    ranked,
    score,
)
from porotwin_solver.effects import EFFECTS

SCREENING, SCREENING_COLUMNS = 2, 40
"""Cells of the recording per screening cell, each way, as long as so many columns are left."""

JUDGING, FINEST = 2, 3
"""Cells per cell of the recording in the final judgement, each way, and in the one run of every
judged model that tells what its cells do wrong."""

MOST_CELLS = 250_000
"""Cells above which no effect is simulated that is slow on fine grids: it would take minutes."""

EXTRAPOLATION = 1.6
"""How many times the change from judging to finest cells is taken off (Richardson): with errors
that fall with the cells' size to the power of 1 to 1.4, as seen, it would be 2.3 to 3.3 in full."""

REFINED, JUDGED = 7, 4
"""How many fits go on at most, to refinement and to judgement."""

AT_A_WELL = 5.0
"""Cells about a well within which a leak cannot be told from a wrong rate of that well."""

EDGE_BLUR = 0.55
"""Blur [cells] by which recorded maps are softer than averages over cells, until measured."""

BLURS = (0.3, 0.9)
"""Least and largest blur [cells] that is put down to the camera."""

ROUGH_SANDS = 2
"""Sands with which it is measured what a model magnifies."""

SMALL_EXCESS = 0.8
"""Excess of the model as it is below which the model without any effect counts as the best."""


class Levels:
    """Fits recordings of one rig on cells of growing fineness.

    `screening` has cells twice as large as the recording, `refining` its own, `judging` such half
    as large, where the scheme smears least; one run on the `finest` tells what those do wrong.
    """

    def __init__(self, samples: Sequence[Sample], *, progress: Progress, workers: int) -> None:
        """Fit `samples` with `workers` simulations at a time."""
        self.samples = list(samples)
        self.progress = progress
        self.pool = ThreadPoolExecutor(workers) if workers > 1 else None
        coarse = [coarsened(sample, _screening_factor(sample)) for sample in samples]
        self.screening = self._fitter(coarse, 1, 0.5 * EDGE_BLUR)
        self.refining = self._fitter(samples, 1, EDGE_BLUR)
        rough = [
            [Forward(on_rough_sand(sample, seed), refinement=JUDGING) for sample in samples]
            for seed in range(ROUGH_SANDS)
        ]
        self.judging = self._fitter(samples, JUDGING, EDGE_BLUR, rough)
        self.finest = [Forward(sample, refinement=FINEST) for sample in samples]

    def _fitter(
        self,
        samples: Sequence[Sample],
        refinement: int,
        soft: float,
        rough: Sequence[Sequence[Forward]] = (),
    ) -> Fitter:
        forwards = [Forward(sample, refinement=refinement) for sample in samples]
        return Fitter(forwards, soft=soft, rough=rough, pool=self.pool)

    @property
    def runs(self) -> int:
        """How many simulations were made."""
        fitters = (self.screening, self.refining, self.judging)
        forwards = [forward for fitter in fitters for forward in fitter.forwards]
        return sum(forward.runs for forward in (*forwards, *self.finest))

    def null(self) -> Fit:
        """Return the model without any effect, judged."""
        return self.judging.judged((), np.zeros(0))

    def lean(self, effects: Sequence[EffectDescription]) -> None:
        """Correct coarse runs from now on by what the judging cells change with `effects`."""
        for fitter in (self.screening, self.refining):
            for forward, finer in zip(fitter.forwards, self.judging.forwards, strict=True):
                forward.lean_on(finer, effects)

    def refined(self, fits: Sequence[Fit], begin: float) -> list[Fit]:
        """Return `fits` refitted on the recording's cells; progress is at `begin`."""
        refined = []
        for index, fit in enumerate(fits):
            self.progress(f'refining {fit.label}', begin + 0.06 * index / len(fits))
            refined.append(
                self.refining.fit(fit.members, start=fit.scaled, coarse_steps=0, fine_steps=3)
            )
        return sorted(possible(refined), key=score)

    def judged(self, refined: Sequence[Fit], begin: float) -> list[Fit]:
        """Return the best of `refined`, refitted on the judging cells; progress is at `begin`."""
        judged = []
        for index, fit in enumerate(near(refined)[:JUDGED]):
            self.progress(f'judging {fit.label}', begin + 0.08 * index / JUDGED)
            judged.append(self.judging.polished(fit, self.refining))
        return self.ranked(possible(judged))

    def sharpened(self, fits: Sequence[Fit], null: Fit, begin: float) -> list[Fit]:
        """Return `fits` judged again: what nearly closes the gap with what finer cells change in it
        and with the edge blur that suits it, the others with the blur of the best, which may be the
        model without any effect, `null`.

        A picture that is moved is also blurred; a wrong model's blur would be that of its misplaced
        fronts.
        """
        if not fits:
            return []
        best = null if normalised_misfit(null) < SMALL_EXCESS else fits[0]
        self.measure_blur(best)
        closing = [fit for fit in fits if normalised_misfit(fit) <= NEARLY_CLOSED]
        far = [fit for fit in fits if normalised_misfit(fit) > NEARLY_CLOSED]
        polished = []
        for index, fit in enumerate([*closing, *far]):
            self.progress(f'polishing {fit.label}', begin + 0.05 * index / len(fits))
            self.attune(best if fit in far else fit)
            polished.append(self.judging.polished(fit, self.refining))
        self.attune(best)
        return self.ranked(polished)

    def attune(self, fit: Fit) -> None:
        """Judge from now on with blur and finest cells of `fit`, if that nearly closes the gap."""
        if normalised_misfit(fit) > NEARLY_CLOSED:
            return
        for forward, finer in zip(self.judging.forwards, self.finest, strict=True):
            forward.offset = None
            if _is_quick(finer, fit.effects):
                forward.lean_on(finer, fit.effects, extrapolation=EXTRAPOLATION)
        self.measure_blur(fit)

    def measure_blur(self, fit: Fit) -> None:
        """Judge from now on with the edge blur that suits `fit`."""

        def cost(blur: float) -> float:
            self.judging.soft = blur
            return self.judging.judged(fit.members, fit.scaled).fitted

        found = minimize_scalar(cost, bounds=BLURS, method='bounded', options={'xatol': 0.02})
        self.judging.soft = float(found.x)

    def ranked(self, fits: Sequence[Fit]) -> list[Fit]:
        """Return the judged `fits`, the most plausible first, without leaks that moved to a well
        unless all did."""
        return ranked([fit for fit in fits if not self.at_a_well(fit)] or fits)

    def at_a_well(self, fit: Fit) -> bool:
        """Return whether `fit` has a leak at a pump's well, which is that pump's wrong rate."""
        sample = self.samples[0]
        pumping = [sample.rig.wells[name] for name in pumping_wells(self.samples)]
        leaks = [
            effect.parameters
            for effect in fit.effects
            if (places := EFFECTS[effect.name].places) and places.is_rate_at_a_well
        ]
        return any(
            np.hypot(float(leak['x']) - well.x_m, float(leak['z']) - well.z_m)
            < well.radius_m + AT_A_WELL * sample.grid.dx
            for leak in leaks
            for well in pumping
        )

    def change(self, effects: Sequence[EffectDescription]) -> float:
        """Return the relative L2 norm of what `effects` change in the held-out maps, on cells so
        fine that fronts smeared by the scheme do not count."""
        changes = []
        for forward, finer in zip(self.judging.forwards, self.finest, strict=True):
            sharp = finer if _is_quick(finer, effects) else forward
            begin = forward.sample.fitted
            changes.append(relative_error(sharp.maps(effects)[begin:], sharp.maps(())[begin:]))
        return float(np.sqrt(np.mean(np.square(changes))))

    def distances(self, fits: Sequence[Fit]) -> list[float]:
        """Return how far the predictions of `fits` are from the first one's."""
        return [self.judging.distance(fits[0], fit) for fit in fits]


def _is_quick(finest: Forward, effects: Sequence[EffectDescription]) -> bool:
    """Return whether a run of the `finest` cells with `effects` takes seconds."""
    cells = finest.sample.grid.nx * finest.sample.grid.nz * FINEST**2
    slow = any(EFFECTS[effect.name].is_slow_on_fine_grids for effect in effects)
    return cells <= MOST_CELLS or not slow


def _screening_factor(sample: Sample) -> int:
    return SCREENING if sample.grid.nx >= SCREENING * SCREENING_COLUMNS else 1
