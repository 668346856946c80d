"""Recordings on cells of four sizes, and the multifidelity corrections between them.

| level | cells | use |
| --- | --- | --- |
| screening | twice as large as the recording's | every effect is fitted here first |
| refining | the recording's | the best fits go on |
| judging | half as large | the final judgement, where the scheme smears least |
| finest | a third as large | one simulation per judged fit corrects the judging level |

`Levels` is immutable: a correction or another point spread makes another `Levels`, which shares the
simulations made so far.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.optimize import minimize_scalar

from porotwin_core.basis.parallel import AHEAD, Crew
from porotwin_core.geometry.grid import relative_error
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.error_parts import COARSER
from porotwin_diagnosis.data.misfit import misfit
from porotwin_diagnosis.data.noise_estimation import POINT_SPREAD_TOLERANCE
from porotwin_diagnosis.data.sample import Sample, coarsened
from porotwin_diagnosis.model.effect_traits import is_slow_on_fine_grids
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward, whitened_residuals
from porotwin_diagnosis.model.library import pumping_wells
from porotwin_diagnosis.model.polishing import polished
from porotwin_diagnosis.progress import Progress, steps_of
from porotwin_diagnosis.search.ranking import (
    close_to_best,
    feasible,
    normalised_misfit,
    ranked,
    score,
)
from porotwin_diagnosis.thresholds import (
    BEAM,
    CORRECTED_MISFIT,
    NO_GAP_MISFIT,
    WELL_DISTANCE,
)

SCREENING = COARSER
SCREENING_COLUMNS = 60
"""Cells of the recording per screening cell, each way, and the fewest columns of screening cells.
On 45 columns the errors of the cells moved a leak beyond its hole, from where no fit came back."""

JUDGING, FINEST = 2, 3
"""Judging and finest cells per cell of the recording, each way."""

MOST_FINE_CELLS = 250_000
"""Cells above which a simulation with a slow effect takes minutes; it is then left out."""

EXTRAPOLATION = 1.6
"""Factor on the difference between the finest and the judging cells. If errors are proportional to
the cell size to the power 1 to 1.4, as observed, the full Richardson extrapolation from 1/2 to 1/3
would take 2.3 to 3.0. A smaller factor is safe, since the exponent of a recording is not known."""

TYPICAL_POINT_SPREAD = 0.55
"""Point spread width [cells] that is assumed before it is measured."""

POINT_SPREAD_RANGE = (0.3, 0.9)
"""Least and largest point spread width [cells] that is attributed to the camera."""

REFINING_ITERATIONS = 3
"""Iterations of a fit on the cells of the recording, which starts close to its optimum."""

STAGE_PROGRESS = 0.03
"""Share of the progress that a stage takes."""

Item = TypeVar('Item')
Made = TypeVar('Made')


@dataclass(frozen=True, eq=False)
class Levels:
    """Fitters of the same recordings on cells of different size.

    Attributes:
        samples: the recordings.
        screening: fitter on coarse cells.
        refining: fitter on the cells of the recordings.
        judging: fitter on fine cells.
        finest: forward models on the finest cells, one per recording.
        progress: called with the stage and the fraction done.
        crew: runs the simulations; None: the thread that wants one does.
        pool: threads that compare these simulations; None for one at a time.
    """

    samples: tuple[Sample, ...]
    screening: Fitter
    refining: Fitter
    judging: Fitter
    finest: tuple[Forward, ...]
    progress: Progress
    crew: Crew | None = None
    pool: Executor | None = None

    def side_by_side(self, function: Callable[[Item], Made], items: Sequence[Item]) -> list[Made]:
        """Return the results of `function` for all `items`, in their order.

        With several workers the calls run at the same time. They do not run in `pool`, because they
        wait for the slopes in it.
        """
        if self.crew is None or self.pool is None or len(items) < 2:
            return [function(item) for item in items]
        with self.crew.threads(len(items)) as threads:
            return list(threads.map(function, items))

    def as_made(self, function: Callable[[Item], Made], items: Sequence[Item]) -> Iterator[Made]:
        """Yield the results of `function` for all `items`, each as soon as it is there."""
        if self.crew is None or self.pool is None:
            yield from map(function, items)
            return
        with self.crew.threads(len(items)) as threads:
            for made in as_completed([threads.submit(function, item) for item in items]):
                yield made.result()

    @property
    def simulations(self) -> int:
        """Number of different simulations so far, without those on rough sand."""
        fitters = (self.screening, self.refining, self.judging)
        forwards = [forward for fitter in fitters for forward in fitter.forwards]
        return sum(forward.simulations for forward in (*forwards, *self.finest))

    def null(self) -> Fit:
        """Return the model without effects, judged."""
        return self.judging.evaluate((), np.zeros(0))

    def with_corrected_coarse_cells(self, effects: Sequence[EffectDescription]) -> 'Levels':
        """Return levels whose screening and refining are corrected at `effects`.

        The correction is the difference between the judging cells and theirs (see
        `Forward.corrected_by`).

        Raises:
            InputError: the model cannot run with these effects.
        """

        def corrected(fitter: Fitter) -> Fitter:
            pairs = zip(fitter.forwards, self.judging.forwards, strict=True)
            return replace(
                fitter,
                forwards=[forward.corrected_by(finer, effects) for forward, finer in pairs],
            )

        return replace(self, screening=corrected(self.screening), refining=corrected(self.refining))

    def corrected_at(self, fit: Fit) -> 'Levels':
        """Return levels whose judging is corrected at `fit` and has the point spread that suits it.

        The correction is the extrapolated difference between the finest and the judging cells. A
        fit that leaves much of the gap changes nothing: its fronts lie elsewhere than those of the
        fits that are judged with its correction. The point spread needs a fit that nearly closes
        the gap, because misplaced fronts look like a wide one.

        Raises:
            InputError: the model cannot run with this fit.
        """
        if normalised_misfit(fit) > CORRECTED_MISFIT:
            return self
        forwards = [
            forward.corrected_by(finer, fit.effects, extrapolation=EXTRAPOLATION)
            if _is_quick(finer, fit.effects)
            else forward.uncorrected()
            for forward, finer in zip(self.judging.forwards, self.finest, strict=True)
        ]
        corrected = replace(self, judging=replace(self.judging, forwards=forwards))
        judged = corrected.judging.evaluated_again(fit)
        if normalised_misfit(judged) > CORRECTED_MISFIT:
            return corrected
        return corrected.with_point_spread_of(fit)

    def with_point_spread_of(self, fit: Fit) -> 'Levels':
        """Return levels whose judging has the point spreads that suit `fit`.

        The width of every recording minimises the misfit of its fitted frames: cameras of several
        days need not be equally sharp.

        Raises:
            InputError: the model cannot run with this fit.
        """
        forwards = [
            replace(forward, point_spread_width=own_point_spread_width(forward, fit))
            for forward in self.judging.forwards
        ]
        return replace(self, judging=replace(self.judging, forwards=forwards))

    def refined(self, fits: Sequence[Fit], begin: float) -> list[Fit]:
        """Return `fits` fitted again on the cells of the recordings, the best score first.

        Fits that are not feasible are left out. `begin` is the progress at the beginning.
        """

        step = steps_of(self.progress, begin, STAGE_PROGRESS, len(fits))

        def refine(fit: Fit) -> Fit:
            with step(f'refining {fit.label}'):
                return self.refining.fit(
                    fit.members,
                    start=fit.scaled_parameters,
                    coarse_steps=0,
                    fine_steps=REFINING_ITERATIONS,
                    updated_slopes=True,
                )

        refined = self.side_by_side(refine, fits)
        return sorted(feasible(refined), key=score)

    def judged(self, refined: Sequence[Fit], begin: float) -> list[Fit]:
        """Return the best of the `refined` fits, sorted by score, fitted on the judging cells.

        The result is ranked. `begin` is the progress at the beginning.
        """
        best = close_to_best(refined)[:BEAM]

        step = steps_of(self.progress, begin, STAGE_PROGRESS, len(best))

        def judge(fit: Fit) -> Fit:
            with step(f'judging {fit.label}'):
                return polished(self.judging, fit, self.refining)

        return self.ranked(feasible(self.side_by_side(judge, best)))

    def judged_again(self, fits: Sequence[Fit], null: Fit, begin: float) -> 'Judgement':
        """Return the ranked `fits` judged again on corrected levels.

        Every fit that leaves little of the gap is judged on levels corrected at itself, the others
        on levels corrected at the best model. The best model is the first fit, or `null` if that
        leaves no gap. The returned levels are corrected at it. `begin` is the progress at the
        beginning.

        Raises:
            InputError: the model cannot run with one of the fits.
        """
        if not fits:
            return Judgement(self, [])
        best = null if normalised_misfit(null) < NO_GAP_MISFIT else fits[0]
        levels = self.with_point_spread_of(best)
        closing = [fit for fit in fits if normalised_misfit(fit) <= CORRECTED_MISFIT]
        others = [fit for fit in fits if normalised_misfit(fit) > CORRECTED_MISFIT]
        again = []
        for index, fit in enumerate([*closing, *others]):
            self.progress(f'polishing {fit.label}', begin + STAGE_PROGRESS * index / len(fits))
            levels = levels.corrected_at(best if fit in others else fit)
            again.append(polished(levels.judging, fit, levels.refining))
        return Judgement(levels.corrected_at(best), self.ranked(again))

    def ranked(self, fits: Sequence[Fit]) -> list[Fit]:
        """Return the judged `fits`, the most plausible first.

        Fits with a leak at a pumping well are left out, unless all have one.
        """
        return ranked([fit for fit in fits if not self.has_leak_at_well(fit)] or fits)

    def has_leak_at_well(self, fit: Fit) -> bool:
        """Return whether `fit` has a leak at a pumping well.

        Such a leak cannot be told from a wrong rate of the well.
        """
        sample = self.samples[0]
        pumping = [sample.rig.wells[name] for name in pumping_wells(self.samples)]
        leaks = [effect.parameters for effect in fit.effects if effect.water_ml_h]
        return any(
            np.hypot(float(leak['x']) - well.x_m, float(leak['z']) - well.z_m)
            < well.radius_m + WELL_DISTANCE * sample.grid.dx
            for leak in leaks
            for well in pumping
        )

    def relative_change(self, effects: Sequence[EffectDescription]) -> float:
        """Return the relative L2 norm [-] of the change that `effects` make in the held-out maps.

        It is computed on the finest cells, where smeared fronts of the scheme do not count, or on
        the judging cells if that would take minutes.

        Raises:
            InputError: the model cannot run with these effects.
        """
        changes = []
        for forward, finest in zip(self.judging.forwards, self.finest, strict=True):
            finer = finest if _is_quick(finest, effects) else forward
            begin = forward.sample.fitted_frames
            changes.append(relative_error(finer.maps(effects)[begin:], finer.maps(())[begin:]))
        return float(np.sqrt(np.mean(np.square(changes))))

    def distances(self, fits: Sequence[Fit]) -> list[float]:
        """Return the whitened distances [-] of the predictions of `fits` from the first one.

        Raises:
            InputError: the model cannot run with one of the fits.
        """
        return [self.judging.distance(fits[0], fit) for fit in fits]


class Judgement(NamedTuple):
    """Judged fits, the most plausible first, and the corrected levels of their judgement."""

    levels: Levels
    fits: list[Fit]


def make_levels(
    samples: Sequence[Sample], *, progress: Progress, crew: Crew | None = None
) -> Levels:
    """Return the levels of `samples` of one rig, without corrections.

    Args:
        samples: the recordings.
        progress: called with the stage and the fraction done.
        crew: runs the simulations; None: one at a time.
    """
    alone = crew is None or crew.workers == 1
    pool = None if crew is None or alone else crew.threads(AHEAD * crew.workers)

    def models(refinement: int, seen: Sequence[Sample], width: float) -> list[Forward]:
        return [
            Forward(sample, refinement=refinement, crew=crew, point_spread_width=width)
            for sample in seen
        ]

    coarse = [coarsened(sample, _screening_factor(sample)) for sample in samples]
    return Levels(
        samples=tuple(samples),
        screening=Fitter(
            models(1, coarse, 0.5 * TYPICAL_POINT_SPREAD),
            pool=pool,
        ),
        refining=Fitter(
            models(1, samples, TYPICAL_POINT_SPREAD),
            pool=pool,
        ),
        judging=Fitter(
            models(JUDGING, samples, TYPICAL_POINT_SPREAD),
            pool=pool,
        ),
        finest=tuple(Forward(sample, refinement=FINEST, crew=crew) for sample in samples),
        progress=progress,
        crew=crew,
        pool=pool,
    )


def own_point_spread_width(forward: Forward, fit: Fit) -> float:
    """Return the point spread width [cells] of `forward` that suits `fit` best.

    Raises:
        InputError: the model cannot run with this fit.
    """

    def misfit_at(width: float) -> float:
        spread = replace(forward, point_spread_width=width)
        return misfit([forward.sample], whitened_residuals([spread], fit.effects))[0]

    found = minimize_scalar(
        misfit_at,
        bounds=POINT_SPREAD_RANGE,
        method='bounded',
        options={'xatol': POINT_SPREAD_TOLERANCE},
    )
    return float(found.x)


def _is_quick(finest: Forward, effects: Sequence[EffectDescription]) -> bool:
    """Return whether a simulation of the `finest` cells with `effects` takes seconds."""
    cells = finest.sample.grid.nx * finest.sample.grid.nz * FINEST**2
    return cells <= MOST_FINE_CELLS or not is_slow_on_fine_grids(effects)


def _screening_factor(sample: Sample) -> int:
    return SCREENING if sample.grid.nx >= SCREENING * SCREENING_COLUMNS else 1
