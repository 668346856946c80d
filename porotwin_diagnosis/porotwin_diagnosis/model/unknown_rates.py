"""What nobody measured and every effect meets: rates of sources, and the level of relative maps.

Both are nuisances. A first fit without effects finds them, and the search begins there. In the
search each unknown rate is a mode of `data.shared_errors`: an effect may move it, at the cost of
its prior. At last the rates are fitted beside the kept effects, with the prior of `rig.yaml`. The
log of a rate is normal with the deviation s, and n standard deviations cost as much misfit as those
of other shared errors. A posterior has the inverse covariance

    C^-1 + s^-2,

where C is the covariance of the residuals (`covariance`), widened as all intervals are.

The level of relative maps needs no fit: it is the factor that the prediction leaves open.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from porotwin_core.basis.units import percent, to_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.effect_parameter import HALF_INTERVAL
from porotwin_core.model.levenberg_marquardt import minimise
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.misfit import front_cells
from porotwin_diagnosis.data.sample import (
    COARSE_SMOOTHING_WIDTH,
    SMOOTHING_WIDTH,
    Sample,
    read_sample,
)
from porotwin_diagnosis.data.shared_errors import STOCK_LEVEL, nearest_level
from porotwin_diagnosis.model.covariance import clustered_covariance
from porotwin_diagnosis.model.fit import Fit, effects_at
from porotwin_diagnosis.model.fitter import Fitter, bounds_of
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.library import pumping_wells
from porotwin_diagnosis.thresholds import INTERVAL_DEVIATIONS, SYSTEMATIC_MISFIT
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import ConcentrationMaps, MapSeries
from porotwin_solver.effects.definition.candidate import Candidate
from porotwin_solver.effects.rate import rate_factors, unknown_rates

Series = TypeVar('Series', bound=MapSeries)


@dataclass(frozen=True)
class SourceRate:
    """The rate of a source that nobody measured.

    Attributes:
        well: its name.
        rate_ml_h: median of the posterior of its largest rate.
        interval_ml_h: 90 % interval of the posterior.
        prior_ml_h: 90 % interval in `rig.yaml`.
    """

    well: str
    rate_ml_h: float
    interval_ml_h: tuple[float, float]
    prior_ml_h: tuple[float, float]

    def __str__(self) -> str:
        """Return the rate with both intervals."""
        (low, high), (least, most) = self.interval_ml_h, self.prior_ml_h
        return (
            f'source {self.well} delivers {self.rate_ml_h:.3g} ml/h '
            f'(90 %: {low:.3g} to {high:.3g}; before the maps {least:.3g} to {most:.3g})'
        )


@dataclass(frozen=True, eq=False)
class UnknownRates:
    """The unknown rates of the sources of some recordings, at the rates of their rig.

    Attributes:
        fitter: fits the recordings, whose maps hold no modes of the rates.
        unknown: the factor of every unknown rate, on the rates of the fitter's rig.
    """

    fitter: Fitter
    unknown: tuple[Candidate, ...]

    @property
    def present(self) -> FloatArray:
        """The largest rate of every unknown source as the rig has it [ml/h], (k,)."""
        samples = self.fitter.samples
        factors = rate_factors(samples[0].rig.effects)
        return np.array(
            [
                factors.get(well, 1.0)
                * max(
                    to_ml_h(abs(row.rate.rate))
                    for sample in samples
                    for row in sample.schedule.rows
                    if row.well == well
                )
                for well in self.wells
            ]
        )

    @property
    def wells(self) -> list[str]:
        """The names of the sources, in the order of the factors."""
        return [str(one.fixed['well']) for one in self.unknown]

    @property
    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Mean and deviation of the scaled factors [-] before any map, (k,) each."""
        rig, step = self.fitter.samples[0].rig, [one.parameters[0].step for one in self.unknown]
        believed = [rig.wells[well].believed_rate_ml_h or (0.0, 0.0) for well in self.wells]
        median, deviation = np.array(believed).reshape(-1, 2).T
        return np.log(median / self.present) / step, deviation / step

    def fitted(self, model: Sequence[Candidate], start: FloatArray, width: float) -> FloatArray:
        """Return the scaled parameters (p,) of `model` and rates that suit the fitted frames best.

        Args:
            model: the effects beside the rates.
            start: scaled parameters of the effects and then of the rates, (p,).
            width: width [cells] of the smoothing of residuals.
        """
        fitter = self.fitter
        return self._minimised(
            fitter,
            (*model, *self.unknown),
            start,
            width,
            lambda members, u, left: fitter.slopes(members, u, left, width=width),
        )

    def _minimised(
        self,
        fitter: Fitter,
        members: Sequence[Candidate],
        start: FloatArray,
        width: float,
        slopes: Callable[..., Sequence[FloatArray]],
    ) -> FloatArray:
        """Return the parameters that suit `fitter` and the prior, with `slopes` of residuals."""
        centre, weight = self._prices(len(start))
        return minimise(
            lambda u: [
                *fitter.residuals(effects_at(members, u), width, fitted_only=True),
                weight * (centre - u),
            ],
            lambda u, left: [*slopes(members, u, left[:-1]), np.diag(weight)],
            start,
            bounds_of(members),
            iterations=2 * len(members),
            updated_slopes=fitter is not self.fitter,
        )

    def first_effects(self) -> tuple[EffectDescription, ...]:
        """Return the rates, as effects, that suit the fitted frames best without other effects.

        On an open scale the fit begins at low rates as well: at high ones the scale is at its
        bound, where its slope does not show.
        """
        mean, deviation = self.prior
        if not self.unknown:
            return ()
        is_open = any(sample.least_scale is not None for sample in self.fitter.samples)
        starts = [mean, mean - HALF_INTERVAL * deviation][: 1 + is_open]
        coarse = [self.fitted((), start, COARSE_SMOOTHING_WIDTH) for start in starts]
        fits = [self.fitted((), start, SMOOTHING_WIDTH) for start in coarse]
        return effects_at(self.unknown, min(fits, key=self._cost))

    def _cost(self, scaled: FloatArray) -> float:
        """Return the sum of squares that `fitted` minimises, of rates alone."""
        centre, weight = self._prices(len(scaled))
        effects = effects_at(self.unknown, scaled)
        left = self.fitter.residuals(effects, SMOOTHING_WIDTH, fitted_only=True)
        squares = sum(float(np.sum(one**2)) for one in left)
        return squares + float(np.sum((weight * (centre - scaled)) ** 2))

    def with_modes(self) -> tuple[Sample, ...]:
        """Return the samples with the modes of the rates."""
        if not self.unknown:
            return tuple(self.fitter.samples)
        deviations = self.prior[1]
        return tuple(
            replace(
                forward.sample,
                rate_modes=np.stack(
                    [
                        deviation * (forward.maps((one.described((1.0,)),)) - forward.maps(()))
                        for one, deviation in zip(self.unknown, deviations, strict=True)
                    ]
                ),
            )
            for forward in self.fitter.forwards
        )

    def beside(self, model: Fit) -> tuple[Fit, list[SourceRate]]:
        """Return the joint fit of `model` and the rates, and the posterior of the rates.

        Cells half as large correct the parameters, and the correction adds to the covariance.

        Raises:
            InputError: the model cannot run with the effects.
        """
        if not self.unknown:
            return model, []
        members = (*model.members, *self.unknown)
        nothing = np.zeros(len(self.unknown))
        start = np.concatenate([model.scaled_parameters, nothing])
        scaled = self.fitted(model.members, start, SMOOTHING_WIDTH)
        residuals = self.fitter.residuals(
            effects_at(members, scaled), SMOOTHING_WIDTH, fitted_only=True
        )
        slopes = self.fitter.slopes(members, scaled, residuals)
        moved = self._minimised(self._finer, members, scaled, SMOOTHING_WIDTH, lambda *_at: slopes)
        widening = (INTERVAL_DEVIATIONS / HALF_INTERVAL) ** 2
        variance = (moved - scaled) ** 2
        if any(sample.least_scale is not None for sample in self.fitter.samples):  # of the core
            steps = [one.parameters[0].step for one in self.unknown]
            variance[-len(steps) :] += (STOCK_LEVEL / np.array(steps)) ** 2
        own = widening * (clustered_covariance(slopes, residuals) + np.diag(variance))
        precision = np.zeros(len(scaled))
        precision[len(model.scaled_parameters) :] = self.prior[1] ** -2.0
        covariance = np.linalg.pinv(np.linalg.pinv(own, hermitian=True) + np.diag(precision))
        fit = replace(self.fitter.evaluate(members, moved), covariance=covariance / widening)
        return fit, self._posterior(moved, np.sqrt(np.diag(covariance)))

    def _prices(self, size: int) -> tuple[FloatArray, FloatArray]:
        """Return the centre of the prior and the weight of a step from it, (`size`,) each.

        Effects come first and have no prior.
        """
        mean, deviation = self.prior
        cost = SYSTEMATIC_MISFIT**2 * front_cells(self.fitter.samples)[0]
        none = np.zeros(size - len(mean))
        return np.append(none, mean), np.append(none, np.sqrt(cost) / deviation)

    @property
    def _finer(self) -> Fitter:
        """The same on cells half as large."""
        return _fitter(self.fitter.samples, 2, self.fitter.forwards[0].crew)

    def _posterior(self, scaled: FloatArray, deviations: FloatArray) -> list[SourceRate]:
        """Return the rates at `scaled` parameters (p,) with their `deviations`, effects first."""
        count, wells = len(self.unknown), self.fitter.samples[0].rig.wells
        found = []
        for one, well, present, middle, deviation in zip(
            self.unknown,
            self.wells,
            self.present,
            scaled[-count:],
            deviations[-count:],
            strict=True,
        ):
            half = HALF_INTERVAL * deviation
            low, rate, high = (
                float(present * one.parameters[0].value(u))
                for u in (middle - half, middle, middle + half)
            )
            prior = wells[well].rate_prior_ml_h
            assert prior is not None
            found.append(SourceRate(well, rate, (low, high), prior))
        return found


def beside_the_rates(model: Fit, joint: Fit) -> Fit:
    """Return `model` with its parameters in the `joint` fit, where they come first."""
    count = len(model.scaled_parameters)
    return replace(
        model,
        scaled_parameters=joint.scaled_parameters[:count],
        covariance=joint.covariance[:count, :count],
    )


@dataclass(frozen=True)
class Settled:
    """Recordings as a search begins with them.

    Attributes:
        recordings: at the first rates of their unknown sources, on the scale of the stock.
        samples: their frames, with the modes of the unknown rates.
        sources: the unknown rates.
        levels: concentration [-] of the core of each recording, if its sources deliver stock; None
            where its scale is no relative one.
    """

    recordings: tuple[Recording, ...]
    samples: tuple[Sample, ...]
    sources: UnknownRates
    levels: tuple[float | None, ...]

    def told(self, rates: Sequence[SourceRate]) -> list[str]:
        """Return lines about the `rates`, and about what a relative scale cannot tell."""
        lines = [f'{rate}' for rate in rates]
        for recording, level in zip(self.recordings, self.levels, strict=True):
            if level is not None:
                lines.append(
                    f'{recording.source}: the maps have a relative scale. Fronts tell how much '
                    'water a source delivers, but not how much tracer is in it, nor what makes all '
                    'maps paler alike, such as decay or a loss before the first map. If the '
                    f'sources deliver stock, the core of the plume holds {percent(level)} of it'
                )
        return lines


def settled(recordings: Sequence[Recording], *, crew: Executor | None = None) -> Settled:
    """Return `recordings` of one rig as a search begins with them; `crew` runs simulations.

    Recordings with known rates and a known scale stay as they are.

    Raises:
        InputError: a recording cannot be diagnosed.
    """
    samples = tuple(read_sample(recording) for recording in recordings)
    sources = sources_of(samples, crew=crew)
    relative = [sample.least_scale is not None for sample in samples]
    if not sources.unknown and not any(relative):
        return Settled(tuple(recordings), samples, sources, (None,) * len(samples))
    found, levels = at_first_rates(sources)
    rig = found.fitter.samples[0].rig
    recordings = [
        replace(one, rig=rig, maps=_scaled(one.present_maps, level))
        for one, level in zip(recordings, levels, strict=True)
    ]
    samples = tuple(
        replace(read_sample(one), least_scale=level if unscaled else None)
        for one, level, unscaled in zip(recordings, levels, relative, strict=True)
    )
    sources = sources_of(samples, crew=crew)
    cores = (level if unscaled else None for level, unscaled in zip(levels, relative, strict=True))
    return Settled(tuple(recordings), sources.with_modes(), sources, tuple(cores))


def at_first_rates(sources: UnknownRates) -> tuple[UnknownRates, list[float]]:
    """Return `sources` at the rates that suit the fitted frames best without effects.

    Relative maps are brought to the scale of the stock. With them come the factors that do so [-].
    Tracer of the first map is on their scale too, so that the next round may find another one.
    """
    samples, factors = list(sources.fitter.samples), np.ones(len(sources.fitter.samples))
    rounds = 1 if all(sample.initial is None for sample in samples) else 3
    for _ in range(rounds):
        effects = sources.first_effects()
        levels = [_level(forward, effects) for forward in sources.fitter.forwards]
        rig = samples[0].rig.with_effects(effects)
        samples = [
            replace(_rescaled(sample, level), rig=rig)
            for sample, level in zip(samples, levels, strict=True)
        ]
        factors *= levels
        sources = sources_of(samples, crew=sources.fitter.forwards[0].crew)
    return sources, list(factors)


def _rescaled(sample: Sample, factor: float) -> Sample:
    """Return `sample` with its maps times `factor`."""
    own, initial, least = sample.own_deviation, sample.initial, sample.least_scale
    return replace(
        sample,
        observed=factor * sample.observed,
        own_deviation=None if own is None else factor * own,
        initial=None if initial is None else factor * initial,
        least_scale=None if least is None else factor * least,
    )


def _level(forward: Forward, effects: Sequence[EffectDescription]) -> float:
    """Return the factor [-] that brings relative maps to the scale of the stock; 1 for others."""
    sample = forward.sample
    if sample.least_scale is None:
        return 1.0
    maps = forward.maps(effects)
    return float(1.0 / nearest_level(maps, sample.at_scale(maps)))


def sources_of(samples: Sequence[Sample], *, crew: Executor | None = None) -> UnknownRates:
    """Return the unknown rates of `samples` of one rig; `crew` runs the simulations."""
    unknown = unknown_rates(samples[0].rig, pumping_wells(samples))
    return UnknownRates(_fitter(samples, 1, crew), tuple(unknown))


def _fitter(samples: Sequence[Sample], refinement: int, crew: Executor | None) -> Fitter:
    return Fitter([Forward(sample, refinement=refinement, crew=crew) for sample in samples])


def _scaled(maps: ConcentrationMaps, factor: float) -> ConcentrationMaps:
    """Return `maps` and their deviations times `factor`."""

    def scaled(series: Series) -> Series:
        return replace(series, read=lambda start, stop: factor * series.read(start, stop))

    deviation, systematic = (one and scaled(one) for one in (maps.deviation, maps.systematic))
    return replace(scaled(maps), deviation=deviation, systematic=systematic)
