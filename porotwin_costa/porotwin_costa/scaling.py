"""How physical quantities become network inputs and outputs."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from porotwin_costa.dataset import Dataset
from porotwin_costa.network import NetworkSettings


@dataclass(frozen=True)
class Scaling:
    """Input (c~ - `offset`) / `spread`; rates / `rate` [m^3/s]; sigma = output * `sigma` [1/s]."""

    offset: float
    spread: float
    rate: float
    sigma: float

    @classmethod
    def of(cls, dataset: Dataset, network: NetworkSettings) -> Self:
        """Return the scales of a data set; the local network needs c~ as it is."""
        standard = network.architecture == 'paper'
        return cls(
            offset=float(dataset.predicted.mean()) if standard else 0.0,
            spread=float(dataset.predicted.std()) or 1.0 if standard else 1.0,
            rate=float(np.abs(dataset.rates).max()) or 1.0,
            sigma=float(np.sqrt(np.mean(np.square(dataset.residual, dtype=float)))) or 1.0,
        )
