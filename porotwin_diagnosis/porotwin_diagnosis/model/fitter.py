"""Fits of effects to the first part of recordings, with free-running simulations.

The parameters minimise the sum of squares of the whitened residuals over the fitted frames
(`levenberg_marquardt`). Slopes are finite differences. The first iterations use coarsely smoothed
residuals: fronts that lie cells apart have no gradient at the resolution of the maps.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.levenberg_marquardt import TRIALS, Bounds, SlopesFn, minimise
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.misfit import (
    front_cells,
    misfit,
    noise_misfit,
    with_squares,
)
from porotwin_diagnosis.data.sample import (
    COARSE_SMOOTHING_WIDTH,
    SMOOTHING_WIDTH,
    Sample,
)
from porotwin_diagnosis.model.covariance import clustered_covariance
from porotwin_diagnosis.model.effect_traits import needs_simulation
from porotwin_diagnosis.model.fit import (
    Fit,
    effects_at,
    infeasible_fit,
    member_slices,
    with_noise_share,
)
from porotwin_diagnosis.model.forward import Forward, whitened_residuals
from porotwin_diagnosis.thresholds import MOVING_PRICE, SYSTEMATIC_MISFIT
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter

FREE_ITERATIONS_FACTOR = 8
"""Factor on the number of iterations of a fit that needs no simulation: they cost next to nothing,
and the four parameters of a registration have a narrow valley."""

CENTRAL_DIFFERENCE = 0.25
"""Half the difference [scaled] of a central derivative: smaller than the width of the minimum
of a registration, and far above round-off."""

ONE_SIDED_DIFFERENCE = 1.0
"""Difference [scaled] of a one-sided derivative: one natural step, which changes the maps clearly
more than the round-off and the limiters of a scheme do."""


@dataclass(frozen=True, eq=False)
class Fitter:
    """Fits effects to recordings of one rig; an effect has the same parameters in all of them.

    Attributes:
        forwards: one forward model per recording.
        noise_share: share of the expected noise that counts (see `search.noise_bound`).
        pool: takes finite differences at the same time; None for one at a time.
    """

    forwards: Sequence[Forward]
    noise_share: float = field(default=1.0, kw_only=True)
    pool: Executor | None = field(default=None, kw_only=True)

    @property
    def samples(self) -> list[Sample]:
        """The recordings, in the order of the forward models."""
        return [forward.sample for forward in self.forwards]

    def residuals(
        self, effects: Sequence[EffectDescription], width: float, *, fitted_only: bool = False
    ) -> list[FloatArray]:
        """Return the whitened residuals with `effects`, smoothed over `width` [cells].

        Returns:
            One array (nt, nz', nx') [-] per recording: all frames, or the fitted ones and then
            `reading_residuals`.

        Raises:
            InputError: the model cannot run with these effects.
        """
        maps = whitened_residuals(self.forwards, effects, width=width, fitted_only=fitted_only)
        return [*maps, *self.reading_residuals(effects)] if fitted_only else maps

    def reading_residuals(self, effects: Sequence[EffectDescription]) -> list[FloatArray]:
        """Return the residuals of the readings, (1, 1, n) [-] per recording that has some.

        A deviation z adds (`SYSTEMATIC_MISFIT` z)^2 to misfit^2, so that log-odds change by z^2/2.

        Raises:
            InputError: the model cannot run with these effects.
        """
        cost = SYSTEMATIC_MISFIT * np.sqrt(front_cells(self.samples)[0])
        return [
            cost * forward.readings_off(effects)[None, None]
            for forward in self.forwards
            if forward.sample.readings
        ]

    def _reading_squares(self, effects: Sequence[EffectDescription]) -> tuple[float, float]:
        """Return the part of the readings in misfit^2 [-], and the part of their own errors."""
        squares = sum(float(np.sum(one**2)) for one in self.reading_residuals(effects))
        count = sum(len(sample.readings) for sample in self.samples)
        return squares / front_cells(self.samples)[0], SYSTEMATIC_MISFIT**2 * count

    def fit(
        self,
        members: Sequence[Candidate],
        *,
        start: FloatArray | None = None,
        coarse_steps: int = 3,
        fine_steps: int = 3,
        updated_slopes: bool = False,
    ) -> Fit:
        """Return the best fit of `members` together.

        Args:
            members: the effects.
            start: scaled parameters (p,); by default the first start of every member.
            coarse_steps: iterations on coarsely smoothed residuals.
            fine_steps: iterations on finely smoothed residuals, after those.
            updated_slopes: whether slopes are taken once per width, and then updated.

        Effects of the camera alone need no simulation and take eight times as many iterations, with
        new slopes in each. The fit is not feasible if the model cannot run with the effects.
        """
        if all_of_the_camera(members):
            coarse_steps *= FREE_ITERATIONS_FACTOR
            fine_steps *= FREE_ITERATIONS_FACTOR
            updated_slopes = False
        scaled = np.concatenate([member.first for member in members]) if start is None else start
        scaled = np.array(scaled, dtype=float)
        for width, iterations in (
            (COARSE_SMOOTHING_WIDTH, coarse_steps),
            (SMOOTHING_WIDTH, fine_steps),
        ):
            if iterations:
                scaled = self.minimised(
                    members, scaled, width, iterations, updated_slopes=updated_slopes
                )
        return self.evaluate(members, scaled)

    def evaluated_again(self, fit: Fit) -> Fit:
        """Return `fit` with the misfits and errors of this fitter; the covariance becomes zero."""
        return self.evaluate(
            fit.members, fit.scaled_parameters, held_out_parameters=fit.held_out_parameters
        )

    def evaluate(
        self,
        members: Sequence[Candidate],
        scaled_parameters: FloatArray,
        *,
        held_out_parameters: FloatArray | None = None,
    ) -> Fit:
        """Return the fit of `members` at `scaled_parameters` (p,), with its misfits and errors.

        The covariance stays zero. The fit is not feasible if the model cannot run.

        With `held_out_parameters` (p,) the misfit of the held-out frames is sqrt(h^2 + P g), if
        that is less: h is their misfit at these parameters, g the square of the fitted misfit that
        they add, and P is `MOVING_PRICE`.
        """
        fit = self._evaluated(members, scaled_parameters)
        if held_out_parameters is None or np.array_equal(held_out_parameters, scaled_parameters):
            return fit
        moved = self._evaluated(members, held_out_parameters)
        price = MOVING_PRICE * max(moved.fitted_misfit**2 - fit.fitted_misfit**2, 0.0)
        misfit_moved = float(np.sqrt(moved.held_out_misfit**2 + price))
        if not misfit_moved < fit.held_out_misfit:
            return fit
        unshared = float(np.sqrt(moved.unshared_misfit[1] ** 2 + price))
        return replace(
            fit,
            held_out_misfit=misfit_moved,
            unshared_misfit=(fit.unshared_misfit[0], unshared),
            held_out_parameters=held_out_parameters,
        )

    def _evaluated(self, members: Sequence[Candidate], scaled_parameters: FloatArray) -> Fit:
        """Return the fit of `members` with all its frames at `scaled_parameters` (p,)."""
        effects = effects_at(members, scaled_parameters)
        try:
            maps = [forward.maps(effects) for forward in self.forwards]
            added = self._reading_squares(effects)
        except InputError:
            return infeasible_fit(members, scaled_parameters)
        unshared = [
            forward.sample.unshared_residual(shown, point_spread_width=forward.point_spread_width)
            for forward, shown in zip(self.forwards, maps, strict=True)
        ]
        residuals = [
            sample.decorrelated(residual)
            for sample, residual in zip(self.samples, unshared, strict=True)
        ]
        fitted, held_out = with_squares(misfit(self.samples, residuals), added[0])
        size = len(scaled_parameters)
        noise = with_squares(noise_misfit(self.samples, residuals), added[1])
        fit = Fit(
            members=tuple(members),
            scaled_parameters=np.array(scaled_parameters, dtype=float),
            fitted_misfit=fitted,
            held_out_misfit=held_out,
            fitted_error=self._relative_error(maps, held_out=False),
            held_out_error=self._relative_error(maps, held_out=True),
            covariance=np.zeros((size, size)),
            noise_misfit=noise,
            expected_noise=noise,
            unshared_misfit=with_squares(misfit(self.samples, unshared), added[0]),
            described=tuple(effect.name for effect in self.samples[0].rig.effects),
        )
        return with_noise_share(fit, self.noise_share)

    def distance(self, one: Fit, other: Fit) -> float:
        """Return the whitened root mean square difference [-] of two predictions.

        The distance is the difference of the residuals per compared cell with tracer, and of the
        readings as in `reading_residuals`. The noise of the recordings cancels.

        Raises:
            InputError: the model cannot run with one of the fits.
        """
        pairs = zip(
            self.residuals(one.effects, SMOOTHING_WIDTH),
            self.residuals(other.effects, SMOOTHING_WIDTH),
            strict=True,
        )
        total = sum(float(np.sum((first - second) ** 2)) for first, second in pairs)
        cells = sum(sample.tracer_cells for sample in self.samples)
        readings = zip(*map(self.reading_residuals, (one.effects, other.effects)), strict=True)
        apart = sum(float(np.sum((first - second) ** 2)) for first, second in readings)
        return float(np.sqrt(total / max(cells, 1) + apart / front_cells(self.samples)[0]))

    def with_covariance(self, fit: Fit) -> Fit:
        """Return `fit` with the covariance of its scaled parameters (see `covariance`).

        Raises:
            InputError: the model cannot run with the fit.
        """
        if not len(fit.scaled_parameters):
            return fit
        residuals = self.residuals(fit.effects, SMOOTHING_WIDTH, fitted_only=True)
        slopes = self.slopes(fit.members, fit.scaled_parameters, residuals)
        return replace(fit, covariance=clustered_covariance(slopes, residuals))

    def responses(
        self, members: Sequence[Candidate], scaled_parameters: FloatArray, *, first: int = 0
    ) -> list[FloatArray]:
        """Return the derivatives of the whitened prediction by the scaled parameters, all frames.

        Args:
            members: the effects.
            scaled_parameters: where to differentiate, (p,).
            first: index of the first parameter to differentiate by.

        Returns:
            One array (p - first, nt, nz', nx') per recording.

        Raises:
            InputError: the model cannot run with these effects.
        """
        present = [
            member.described(scaled_parameters[part].tolist())
            for member, part in member_slices(members)
            if not member.is_absent(scaled_parameters[part].tolist())
        ]
        residuals = self.residuals(present, SMOOTHING_WIDTH)
        return self.slopes(members, scaled_parameters, residuals, fitted_only=False, first=first)

    def slopes(
        self,
        members: Sequence[Candidate],
        scaled_parameters: FloatArray,
        residuals: Sequence[FloatArray],
        *,
        width: float = SMOOTHING_WIDTH,
        fitted_only: bool = True,
        first: int = 0,
    ) -> list[FloatArray]:
        """Return minus the derivatives of the residuals by the scaled parameters.

        Differences are one-sided if every point takes a simulation, central otherwise, and stay
        within the ranges of the parameters. A derivative is zero if the model cannot run on either
        side.

        Args:
            members: the effects.
            scaled_parameters: where to differentiate, (p,).
            residuals: residuals at that point, as `residuals` returns them.
            width: width [cells] of the smoothing.
            fitted_only: whether `residuals` hold the fitted frames only.
            first: index of the first parameter to differentiate by.

        Returns:
            One array (p - first, nt, nz', nx') for each of `residuals`.
        """
        central = all_of_the_camera(members)
        parameters = _parameters(members)

        def residuals_at(index: int, value: float) -> Sequence[FloatArray]:
            if value == scaled_parameters[index]:
                return residuals
            moved = scaled_parameters.copy()
            moved[index] = value
            return self.residuals(effects_at(members, moved), width, fitted_only=fitted_only)

        def slope(index: int) -> list[FloatArray]:
            spans = _difference_spans(parameters[index], scaled_parameters[index], central=central)
            for begin, end in spans:
                try:
                    pairs = zip(residuals_at(index, begin), residuals_at(index, end), strict=True)
                except InputError:
                    continue
                return [(before - after) / (end - begin) for before, after in pairs]
            return [np.zeros_like(residual) for residual in residuals]

        run: Callable[..., Iterable[list[FloatArray]]] = map if self.pool is None else self.pool.map
        columns = list(run(slope, range(first, len(parameters))))
        return [np.stack([column[n] for column in columns]) for n in range(len(residuals))]

    def minimised(
        self,
        members: Sequence[Candidate],
        start: FloatArray,
        width: float,
        iterations: int,
        *,
        slopes_at: SlopesFn | None = None,
        trials: int = TRIALS,
        updated_slopes: bool = False,
    ) -> FloatArray:
        """Return the scaled parameters (p,) that suit the fitted frames best.

        Args:
            members: the effects.
            start: scaled parameters at the beginning, (p,).
            width: width [cells] of the smoothing.
            iterations: largest number of iterations.
            slopes_at: slopes of the residuals; by default the slopes of this fitter.
            trials: trial steps per iteration.
            updated_slopes: whether slopes are taken once, and then updated.
        """
        return minimise(
            lambda scaled: self.residuals(effects_at(members, scaled), width, fitted_only=True),
            slopes_at
            or (lambda scaled, residuals: self.slopes(members, scaled, residuals, width=width)),
            start,
            bounds_of(members),
            iterations=iterations,
            trials=trials,
            updated_slopes=updated_slopes,
        )

    def _relative_error(self, maps: Sequence[FloatArray], *, held_out: bool) -> float:
        """Return the relative L2 error, as a root mean square over the recordings."""
        errors = [
            sample.relative_error(shown, held_out=held_out)
            for sample, shown in zip(self.samples, maps, strict=True)
        ]
        return float(np.sqrt(np.mean(np.square(errors))))


def _parameters(members: Sequence[Candidate]) -> list[FitParameter]:
    return [parameter for member in members for parameter in member.parameters]


def bounds_of(members: Sequence[Candidate]) -> Bounds:
    """Return the bounds of the scaled parameters of all `members`."""
    ranges = np.array([parameter.range for parameter in _parameters(members)]).reshape(-1, 2)
    return Bounds(*ranges.T)


def all_of_the_camera(members: Sequence[Candidate]) -> bool:
    """Return whether all `members` are effects of the camera, which need no simulation."""
    return not any(needs_simulation(member.effect) for member in members)


def _difference_spans(
    parameter: FitParameter, scaled: float, *, central: bool
) -> list[tuple[float, float]]:
    """Return the spans over which to differentiate at `scaled`, in the order of preference."""
    low, high = parameter.range
    if central:
        spans = [(max(scaled - CENTRAL_DIFFERENCE, low), min(scaled + CENTRAL_DIFFERENCE, high))]
    else:
        down = (scaled, max(scaled - ONE_SIDED_DIFFERENCE, low))
        up = (scaled, scaled + ONE_SIDED_DIFFERENCE)
        spans = [up, down] if up[1] <= high else [down]
    return [(begin, end) for begin, end in spans if begin != end]
