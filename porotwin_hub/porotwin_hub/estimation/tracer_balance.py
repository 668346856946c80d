"""Compares the tracer in a photograph with the tracer that the pumps can have left there.

A photograph of another rig, a damaged picture, or a baseline with tracer in it passes all checks of
the light. It does not pass a balance: tracer appears or vanishes that no pump moved.
"""

import math

import numpy as np

from porotwin_checks.checks.tracer_amount import amount_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.grid import FloatArray


class PumpedTracer:
    """Follows the volume of tracer by the rates of the pumps, whatever photographs show."""

    def __init__(self, pore_volume: FloatArray) -> None:
        """Begin with the first state; `pore_volume` (nz, nx) [m^3] belongs to the cells."""
        self._pore_volume = pore_volume
        self.forget()

    def forget(self) -> None:
        """Begin again with the next state."""
        self._pumped = math.nan

    def remark(
        self,
        observed: FloatArray,
        state: FloatArray,
        predicted: FloatArray,
        *,
        pumped: float,
        assumed: float,
    ) -> Remark | None:
        """Return the remark that a photograph does not fit the pumps; None if it does.

        Args:
            observed: concentration in the photograph [-], (nz, nx); NaN where nothing was seen.
            state: the state before, (nz, nx) [-].
            predicted: the prediction from it for the photograph, (nz, nx) [-].
            pumped: tracer that the pumps injected meanwhile, by their rates [m^3].
            assumed: tracer that the prediction injected [m^3].
        """
        before, after = (float(np.sum(self._pore_volume * one)) for one in (state, predicted))
        if math.isnan(self._pumped):
            self._pumped = before
        left = max(before + assumed - after, 0.0)
        self._pumped = max(self._pumped + pumped - left, 0.0)
        share = self._pumped / after if after > 0.0 else 0.0
        return imbalance(observed, share * predicted, self._pore_volume)


def imbalance(
    observed: FloatArray, predicted: FloatArray, pore_volume: FloatArray
) -> Remark | None:
    """Return the remark that an observed map has too much or too little tracer; None if not.

    The volumes are sums of concentration times pore volume over the observed cells.

    Args:
        observed: concentration in the photograph [-], (nz, nx); NaN where nothing was seen.
        predicted: concentration if all tracer of the pumps is there [-], (nz, nx).
        pore_volume: volume of the pores of each cell [m^3], (nz, nx).
    """
    seen = np.isfinite(observed)
    found = float(np.sum(observed[seen] * pore_volume[seen]))
    expected = float(np.sum(predicted[seen] * pore_volume[seen]))
    return amount_remark(found, expected, float(pore_volume.sum()), 'the photograph')
