"""The response from known dilutions and from the mass over the photographs of an injection.

The level of tracer stock is known here, so that signals are relative to it. Unknown is the
bend of the curve between water and stock. With the concentration c = h(s) of the relative signal s,

    int h(s) phi d dA = m V(t) + o

holds for all photographs (`mass_balance_fit`). The factor m is often not 1: a porosity is 8 %
wrong, or tracer sorbs. Its prior is a Cauchy distribution about 1: a mass that can agree does
agree, and one that cannot has no say. The bend changes the mass in fronts only, whose share falls
while the plume grows. Beside a model of the flow the fronts show it better (`front_response`).
Dilutions show the curve itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from porotwin_imaging.calibrating.front_response import FrontFit
from porotwin_imaging.calibrating.mass_balance_fit import MASS_BALANCE
from porotwin_imaging.tracer.calibration import STOCK, Response
from porotwin_imaging.tracer.response_curve import MOST_BEND, concentration_of

Array = NDArray[Any]

_BENDS = np.linspace(-MOST_BEND, MOST_BEND, 241)
"""Bends that are tried [-]; the posterior is computed on them."""
_FACTORS = 601
"""Mass factors that are tried; they are evenly spaced in the logarithm, 0.5 % apart."""
_SIGNAL_EDGES = np.linspace(-0.5, 2.0, 501)
"""Edges of the bins of the relative signal, for the histogram of pore volume [-]."""
_POINTS = np.linspace(0.0, 1.2, 25)
"""Points of the response curve [relative signal]."""


@dataclass(frozen=True)
class Dilution:
    """A known dilution.

    Attributes:
        signal: signal relative to stock [-].
        concentration: its concentration [-], 1 = tracer stock.
    """

    signal: float
    concentration: float


@dataclass(frozen=True)
class ResponseFit:
    """The response that the evidence prefers.

    Attributes:
        bend: its bend [-].
        deviation: its standard deviation [-].
        points: relative signals of known dilutions, increasing, with 0 and 1; empty without.
        corrections: additions to the concentration at `points` [-].
    """

    bend: float
    deviation: float
    points: tuple[float, ...] = ()
    corrections: tuple[float, ...] = ()

    def concentration_of(self, signal: Array) -> Array:
        """Return the concentration [-] of relative signals, of the same shape."""
        values = concentration_of(signal, self.bend)
        if not self.points:
            return values
        corrections = PchipInterpolator(self.points, self.corrections)
        return np.asarray(values + corrections(np.clip(signal, 0.0, 1.0)))

    def curve(self, level: float) -> Response:
        """Return the response for signals whose stock has the signal `level`."""
        step = _BENDS[1] - _BENDS[0]
        shifted = [concentration_of(_POINTS, self.bend + sign * step) for sign in (-1.0, 1.0)]
        sensitivity = np.abs(shifted[1] - shifted[0]) / (2 * step)
        values = np.maximum.accumulate(self.concentration_of(_POINTS))
        return Response(
            tuple(map(float, level * _POINTS)),
            tuple(map(float, values)),
            tuple(map(float, self.deviation * sensitivity)),
        )


def fit_response(
    signals: Sequence[Array],
    pore_volume: Array,
    injected: Sequence[float],
    dilutions: Sequence[Dilution] = (),
    fronts: FrontFit | None = None,
) -> ResponseFit:
    """Return the response that masses, fronts and dilutions prefer.

    Args:
        signals: relative signal of each photograph [-], shape (nz, nx), 0 away from tracer.
        pore_volume: phi d dA of the cells [m^3], shape (nz, nx).
        injected: injected volume at each photograph [m^3]; empty without a pump log.
        dilutions: photographs of known dilutions.
        fronts: the bend that the fronts show; None if they were not compared.
    """
    logs = -0.5 * ((_BENDS - MASS_BALANCE.expected_bend) / MASS_BALANCE.bend_deviation) ** 2
    logs = logs + _dilution_evidence(dilutions)
    if fronts is not None:
        logs = logs - 0.5 * ((_BENDS - fronts.bend) / fronts.deviation) ** 2
    if len(injected):
        counts = [_pore_volume_by_signal(plane, pore_volume) for plane in signals]
        logs = logs + _mass_evidence(np.array(counts), np.asarray(injected))
    likely = np.exp(logs - logs.max())
    bend = float(np.average(_BENDS, weights=likely))
    deviation = float(np.sqrt(np.average((_BENDS - bend) ** 2, weights=likely)))
    return ResponseFit(bend, deviation, *_corrections(bend, dilutions))


def _corrections(
    bend: float, dilutions: Sequence[Dilution]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return points and corrections that lead the curve through the known dilutions.

    Photographs of the same dilution are averaged.
    """
    known = sorted({one.concentration for one in dilutions if 0 < one.concentration < STOCK})
    if not known:
        return (), ()
    signals = [
        float(np.mean([one.signal for one in dilutions if one.concentration == value]))
        for value in known
    ]
    if any(high <= low for low, high in pairwise([0.0, *signals, 1.0])):
        return (), ()
    missing = np.array(known) - concentration_of(np.array(signals), bend)
    return (0.0, *signals, 1.0), (0.0, *map(float, missing), 0.0)


def _pore_volume_by_signal(signal: Array, pore_volume: Array) -> Array:
    """Return the pore volume [m^3] in each bin of the relative signal; 0 is no tracer."""
    inside = np.clip(signal, _SIGNAL_EDGES[0], _SIGNAL_EDGES[-1])
    return np.histogram(inside, _SIGNAL_EDGES, weights=pore_volume * (signal != 0))[0]


def _dilution_evidence(dilutions: Sequence[Dilution]) -> Array:
    """Return the log likelihood of each bend by the dilutions."""
    logs = np.zeros(len(_BENDS))
    if not dilutions:
        return logs
    signal = np.array([one.signal for one in dilutions])
    known = np.array([one.concentration for one in dilutions])
    for index, bend in enumerate(_BENDS):
        misfit = (concentration_of(signal, float(bend)) - known) / MASS_BALANCE.log_error
        logs[index] = -0.5 * float(misfit @ misfit)
    return logs


def _mass_evidence(counts: Array, injected: Array) -> Array:
    """Return the log likelihood of each bend by the masses, over all mass factors and offsets.

    The offset is normal and small, or in a few experiments with a fault normal and large.
    """
    middles = 0.5 * (_SIGNAL_EDGES[1:] + _SIGNAL_EDGES[:-1])
    curves = np.stack([concentration_of(middles, float(bend)) for bend in _BENDS])
    largest = injected.max()
    masses = curves @ counts.T / largest  # (bends, photographs)
    volume = injected / largest
    weight = 1.0 / (MASS_BALANCE.photograph_error**2 * (volume**2 + 1.0))
    weight *= min(1.0, MASS_BALANCE.independent_photographs / len(injected))
    widest = np.log(MASS_BALANCE.most_factor)
    logs_of_factor = np.linspace(-widest, widest, _FACTORS)
    apart = masses[:, None, :] - np.exp(logs_of_factor)[None, :, None] * volume
    usual = _over_offsets(apart, weight, MASS_BALANCE.log_error)
    faulty = _over_offsets(apart, weight, MASS_BALANCE.faulty_offset)
    logs = np.logaddexp(
        usual + np.log1p(-MASS_BALANCE.fault_share), faulty + np.log(MASS_BALANCE.fault_share)
    )
    prior = -np.log1p((logs_of_factor / MASS_BALANCE.log_error) ** 2)
    return np.asarray(np.logaddexp.reduce(prior + logs, axis=1))


def _over_offsets(apart: Array, weight: Array, deviation: float) -> Array:
    """Return the log likelihood of masses over all normal offsets, without constants.

    Args:
        apart: differences of the masses without an offset, shape (bends, factors, photographs).
        weight: inverse variances of the photographs, shape (photographs,).
        deviation: standard deviation of the offset, which is the same in all photographs.
    """
    stiff = deviation**-2
    offset = (apart @ weight) / (weight.sum() + stiff)
    misfit = (apart - offset[..., None]) ** 2 @ weight + stiff * offset**2
    return np.asarray(-0.5 * misfit - 0.5 * np.log1p(weight.sum() / stiff))
