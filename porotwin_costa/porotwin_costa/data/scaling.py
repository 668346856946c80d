"""How physical quantities become the inputs and outputs of a network."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_costa.data.dataset import Dataset


@dataclass(frozen=True)
class Scaling:
    """Scales of one data set.

    Inputs are (c~ - `offset`) / `spread` and rates / `rate` [m^3/s]. The output is multiplied by
    `sigma` [1/s].
    """

    offset: float
    spread: float
    rate: float
    sigma: float

    @classmethod
    def of(cls, dataset: Dataset, *, standardise: bool) -> Self:
        """Return the scales of a data set; without `standardise`, c~ stays as it is."""
        return cls(
            offset=float(dataset.predicted.mean()) if standardise else 0.0,
            spread=float(dataset.predicted.std()) or 1.0 if standardise else 1.0,
            rate=float(np.abs(dataset.rates).max()) or 1.0,
            sigma=float(np.sqrt(np.mean(np.square(dataset.residual, dtype=float)))) or 1.0,
        )

    def concentration(self, values: FloatArray) -> FloatArray:
        """Return the network input for concentrations [-] of any shape."""
        return (values - self.offset) / self.spread
