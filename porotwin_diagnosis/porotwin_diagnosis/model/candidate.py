"""Candidate effects of a fit: their parameters with natural steps, ranges and starts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.units import GRAVITY, MOLECULAR_DIFFUSION
from porotwin_diagnosis.data.sample import Sample

IMAGE = ('saturation', 'illumination', 'registration')
"""Effects of the camera that need no simulation of their own."""

CAMERA = (*IMAGE, 'clock')
"""All effects of the camera."""

WELL_STEP = 1.2
"""Step of a well's place in cells of the recording: within a screening cell nothing changes."""

REPLACING = ('dispersion', 'buoyancy', 'viscosity', 'dual_porosity')
"""Effects that take the place of what the rig description says of them; all others add to it."""

LOCAL = ('heterogeneity', 'leak')
"""Effects whose place must be found."""


@dataclass(frozen=True)
class FitParameter:
    """One parameter as a fit scaled it: value = neutral + step u, or neutral exp(step u)."""

    name: str
    unit: str
    neutral: float
    step: float
    low: float = -math.inf
    high: float = math.inf
    log: bool = False

    def value(self, scaled: float) -> float:
        """Return the parameter at `scaled` steps, within its range."""
        if self.log:
            exponent = min(max(self.step * scaled, -60.0), 60.0)
            return float(np.clip(self.neutral * math.exp(exponent), self.low, self.high))
        return float(np.clip(self.neutral + self.step * scaled, self.low, self.high))

    def scaled(self, value: float) -> float:
        """Return the steps at which the parameter has `value`."""
        if self.log:
            return math.log(value / self.neutral) / self.step
        return (value - self.neutral) / self.step

    @property
    def range(self) -> tuple[float, float]:
        """The least and the most steps."""
        low = -math.inf if self.log and self.low <= 0 else self.scaled(self.low)
        return low, self.scaled(self.high)


@dataclass(frozen=True)
class Candidate:
    """An effect to be fitted: its parameters, what is fixed, and where the fit may start."""

    effect: str
    parameters: tuple[FitParameter, ...]
    fixed: dict[str, float | str] = field(default_factory=dict)
    starts: tuple[tuple[float, ...], ...] = ()
    variant: str = ''

    @property
    def label(self) -> str:
        """A name that no other candidate has."""
        parts = [self.effect, str(self.fixed.get('well', '')), self.variant]
        return ' '.join(filter(None, parts))

    def described(self, scaled: Sequence[float]) -> EffectDescription:
        """Return the effect at `scaled`, one per parameter."""
        values = {k.name: k.value(t) for k, t in zip(self.parameters, scaled, strict=True)}
        return EffectDescription(name=self.effect, parameters={**self.fixed, **values})

    def is_absent(self, scaled: Sequence[float]) -> bool:
        """Return whether the effect at `scaled` is known to change nothing: all parameters are
        neutral, and none is a strength that is never zero."""
        return not any(scaled) and all(not k.log or k.neutral == 1.0 for k in self.parameters)

    @property
    def first(self) -> tuple[float, ...]:
        """The start of the fit, in steps: no effect, where the effect allows that."""
        return self.starts[0] if self.starts else (0.0,) * len(self.parameters)


def library(samples: Sequence[Sample]) -> list[Candidate]:
    """Return all candidates for recordings of one rig; those with a place start anywhere yet."""
    rig = samples[0].rig
    return [
        *(_as_nominal(candidate, rig) for candidate in _spreading(samples)),
        *(_as_nominal(candidate, rig) for candidate in _everywhere(samples)),
        *_wells(samples),
        *_camera(samples),
        heterogeneity(rig, (rig.width_m / 2, rig.height_m / 2), 0.06, 1.0),
        *([] if rig.closed else [leak(rig, (rig.width_m / 2, rig.height_m / 2), 0.0)]),
    ]


def nominal_parameters(rig: Rig, effect: str) -> dict[str, float | str] | None:
    """Return the parameters with which the description of `rig` holds a replacing `effect`."""
    if effect not in REPLACING:
        return None
    own = (described for described in reversed(rig.effects) if described.name == effect)
    return next((described.parameters for described in own), None)


def _as_nominal(candidate: Candidate, rig: Rig) -> Candidate:
    """Return `candidate` starting from what the description of `rig` says of it already."""
    own = nominal_parameters(rig, candidate.effect)
    if own is None:
        return candidate
    scaled = tuple(
        parameter.scaled(
            float(
                np.clip(own.get(parameter.name, parameter.neutral), parameter.low, parameter.high)
            )
        )
        for parameter in candidate.parameters
    )
    fixed = {name: own.get(name, value) for name, value in candidate.fixed.items()}
    return replace(candidate, fixed=fixed, starts=(scaled,))


def _speed(sample: Sample) -> float:
    """Return a cell's width per duration [m/s]: what moves a front by one cell."""
    return sample.grid.dx / sample.duration


def _longest(samples: Sequence[Sample]) -> Sample:
    return max(samples, key=lambda sample: sample.duration)


def _spreading(samples: Sequence[Sample]) -> list[Candidate]:
    sample = _longest(samples)
    spread = sample.grid.dx**2 / sample.duration
    along = FitParameter('longitudinal_dispersivity', 'm', 1e-3, 0.25, 1e-6, 0.2, log=True)
    across = FitParameter('transverse_dispersivity', 'm', 1e-4, 0.4, 1e-7, 0.1, log=True)
    diffusion = FitParameter('diffusion', 'm2/s', spread, 0.25, MOLECULAR_DIFFUSION, 1e-5, log=True)
    return [
        Candidate('dispersion', (along, across), {'diffusion': MOLECULAR_DIFFUSION}),
        Candidate(
            'dispersion',
            (diffusion,),
            {'longitudinal_dispersivity': 0.0, 'transverse_dispersivity': 0.0},
            variant='diffusion',
        ),
    ]


def _everywhere(samples: Sequence[Sample]) -> list[Candidate]:
    sample = _longest(samples)
    rig, duration, speed = sample.rig, sample.duration, _speed(sample)
    permeability = float(np.mean(rig.field('permeability_m2', sample.grid)))
    porosity = float(np.mean(rig.field('porosity', sample.grid)))
    sinking = speed * porosity * rig.viscosity_pa_s / (permeability * GRAVITY)
    exchange = FitParameter(
        'exchange_rate', '1/s', 1.0 / duration, 0.5, 1e-3 / duration, 1.0, log=True
    )
    immobile = FitParameter('immobile_fraction', '-', 0.04, 0.3, 1e-4, 0.8, log=True)
    return [
        _single('buoyancy', FitParameter('density_difference', 'kg/m3', 0.0, 2 * sinking)),
        _single('viscosity', FitParameter('viscosity_ratio', '-', 1.0, 0.1, 0.02, 50.0, log=True)),
        _single('retardation', FitParameter('retardation_factor', '-', 1.0, 0.015, 1.0, 20.0)),
        _single('decay', FitParameter('rate', '1/s', 0.0, 0.03 / duration, 0.0, 20.0 / duration)),
        Candidate('dual_porosity', (immobile, exchange), starts=((0.0, 0.0), (0.0, 3.0))),
        _single(
            'porosity', FitParameter('factor', '-', 1.0, 0.015, 0.2, _most_porous(rig), log=True)
        ),
        _single('depth', FitParameter('factor_centre', '-', 1.0, 0.02, 0.1, 5.0)),
        Candidate(
            'background_flow',
            (
                FitParameter('x_velocity', 'm/s', 0.0, speed * porosity),
                FitParameter('z_velocity', 'm/s', 0.0, speed * porosity),
            ),
        ),
    ]


def _single(effect: str, parameter: FitParameter) -> Candidate:
    return Candidate(effect, (parameter,))


def _most_porous(rig: Rig) -> float:
    return 1.0 / float(np.max(np.asarray(rig.nominal_map('porosity'))))


def pumping_wells(samples: Sequence[Sample]) -> list[str]:
    """Return the names of the wells through which something flows in any of `samples`."""
    return [
        name
        for name in samples[0].rig.wells
        if any(row.well == name and row.rate.rate for s in samples for row in s.schedule.rows)
    ]


def _wells(samples: Sequence[Sample]) -> list[Candidate]:
    rig, cell = samples[0].rig, samples[0].grid.dx
    result = []
    for name in pumping_wells(samples):
        well = rig.wells[name]
        if not rig.closed:
            factor = FitParameter('factor', '-', 1.0, 0.02, 0.0, 5.0)
            result.append(Candidate('rate', (factor,), {'well': name}))
        margin = 2 * well.radius_m
        shifts = tuple(
            FitParameter(
                axis,
                'm',
                0.0,
                WELL_STEP * cell,
                min(0.0, margin - place),
                max(0.0, size - margin - place),
            )
            for axis, place, size in (
                ('dx', well.x_m, rig.width_m),
                ('dz', well.z_m, rig.height_m),
            )
        )
        result.append(Candidate('well_position', shifts, {'well': name}))
    return result


def _camera(samples: Sequence[Sample]) -> list[Candidate]:
    sample = _longest(samples)
    rig, cell, duration = sample.rig, sample.grid.dx, sample.duration
    reach = 0.5 * max(rig.width_m, rig.height_m)
    return [
        _single('saturation', FitParameter('exponent', '-', 1.0, 0.1, 0.1, 10.0, log=True)),
        Candidate(
            'illumination',
            (
                FitParameter('drift', '1/s', 0.0, 0.03 / duration),
                FitParameter('gradient', '1/m', 0.0, 0.03 / reach),
            ),
        ),
        Candidate(
            'registration',
            (
                FitParameter('dx', 'm', 0.0, 0.4 * cell, -0.1 * reach, 0.1 * reach),
                FitParameter('dz', 'm', 0.0, 0.4 * cell, -0.1 * reach, 0.1 * reach),
                FitParameter('rotation', 'rad', 0.0, 0.4 * cell / (0.4 * reach), -0.1, 0.1),
                FitParameter('scale', '-', 1.0, 0.4 * cell / (0.4 * reach), 0.9, 1.1),
            ),
        ),
        _single(
            'clock', FitParameter('offset', 's', 0.0, 0.01 * duration, -0.9 * duration, duration)
        ),
    ]


def heterogeneity(rig: Rig, place: tuple[float, float], radius: float, factor: float) -> Candidate:
    """Return the zone whose fit starts at `place` [m], with `radius` [m] and `factor`."""
    size = max(rig.width_m, rig.height_m)
    parameters = (
        FitParameter('x', 'm', place[0], 0.004 * size, 0.0, rig.width_m),
        FitParameter('z', 'm', place[1], 0.004 * size, 0.0, rig.height_m),
        FitParameter('radius', 'm', radius, 0.1, 0.008 * size, 0.4 * size, log=True),
        FitParameter('permeability_factor', '-', 1.0, 0.3, 1e-3, 1e3, log=True),
    )
    return Candidate(
        'heterogeneity', parameters, starts=((0.0, 0.0, 0.0, parameters[3].scaled(factor)),)
    )


def leak(rig: Rig, place: tuple[float, float], rate_ml_h: float) -> Candidate:
    """Return the leak whose fit starts at `place` [m] with `rate_ml_h`.

    Raises:
        InputError: every side of the rig is closed, so that nothing can leak.
    """
    if rig.closed:
        raise InputError('leak: the rig is closed on all sides; open one in rig.yaml')
    size = max(rig.width_m, rig.height_m)
    edge = 0.006
    parameters = (
        FitParameter('x', 'm', place[0], 0.0065 * size, edge, rig.width_m - edge),
        FitParameter('z', 'm', place[1], 0.0065 * size, edge, rig.height_m - edge),
        FitParameter('rate', 'ml/h', 0.0, 8.0),
    )
    return Candidate('leak', parameters, starts=((0.0, 0.0, parameters[2].scaled(rate_ml_h)),))
