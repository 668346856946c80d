"""The signal of tracer stock in the reference sand, and what it is known from."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.calibrating.calibration_evidence import Anchor
from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused
from porotwin_imaging.calibrating.mass_balance_fit import MASS_BALANCE, fit_line
from porotwin_imaging.calibrating.plume_core import CORE, strong_signal
from porotwin_imaging.calibrating.sands import SandFactors
from porotwin_imaging.calibrating.signal_choice import SIGNAL
from porotwin_imaging.calibrating.stock_level import StockLevels
from porotwin_imaging.tracer.calibration import STOCK, UNCALIBRATED_ERROR

Array = NDArray[Any]

_MEASURED = ('dilutions', 'core')
"""Anchors that measure the level of stock; the others take it from the mass."""


class StockSignal(NamedTuple):
    """The signal of tracer stock in the reference sand.

    Attributes:
        anchor: what it is known from.
        level: the signal [-].
        scale_error: its relative standard deviation [-].
    """

    anchor: Anchor
    level: float
    scale_error: float

    @property
    def is_measured(self) -> bool:
        """Whether the level is measured; otherwise the mass tells it."""
        return self.anchor in _MEASURED


def find_stock_signal(
    stock: StockLevels,
    factors: SandFactors,
    diluted: Sequence[tuple[float, float]],
    signals: Sequence[Array],
    integrals: Sequence[float],
    injected: Sequence[float],
    rates_file: str,
) -> StockSignal:
    """Return the signal of tracer stock in the reference sand.

    Args:
        stock: the cores of the plumes.
        factors: the factors of the sands.
        diluted: concentration [-] and signal of the photographs of dilutions.
        signals: signal of each photograph in the scale of the reference sand, (nz, nx).
        integrals: its integral over the pore volume [m^3].
        injected: volume of stock injected before each photograph [m^3]; empty without a log.
        rates_file: name of the file with the injected rates, for messages.

    Raises:
        InputError: there is neither a core nor a dilution, and the signal does not grow with the
            injected mass.
    """
    full = [signal for concentration, signal in diluted if concentration > STOCK]
    if full:
        return StockSignal('dilutions', float(np.median(full)), CORE.level_error)
    if stock.levels:
        one = stock.levels[factors.reference]
        return StockSignal('core', one.level, one.deviation)
    if diluted:
        concentration, signal = max(diluted)
        return StockSignal('dilutions', signal / concentration, SIGNAL.scale_error)
    if injected:
        level, deviation = _level_by_mass(integrals, injected, rates_file)
        return StockSignal('mass', level, deviation)
    return StockSignal('strongest signal', strong_signal(signals), UNCALIBRATED_ERROR)


def _level_by_mass(
    integrals: Sequence[float],
    injected: Sequence[float],
    rates_file: str,
) -> tuple[float, float]:
    """Return the signal of stock that balances the injected mass, and its relative deviation.

    Raises:
        InputError: there are too few photographs, or the signal does not grow.
    """
    fewest = MASS_BALANCE.fewest_photographs
    if len(injected) < fewest:
        raise CalibrationRefused(
            f'calibration: {len(injected)} photographs during the injection; take at least {fewest}'
        )
    line = fit_line(integrals, injected)
    if line.factor <= 0 or line.agree.sum() < fewest:
        raise CalibrationRefused(
            'calibration: the signal does not grow with the injected volume; check '
            f'{rates_file}, the times of the photographs and the baseline'
        )
    return line.factor, max(SIGNAL.scale_error, line.misfit / line.factor)
