"""Wells and leaks on a grid: the water and tracer that they add to the cells."""

from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRates
from porotwin_solver.coefficients.discs import CellArray, disc_fractions
from porotwin_solver.coefficients.physics import Physics, SourceSink
from porotwin_solver.transport.transport import Sources


class ActiveSource(NamedTuple):
    """A source or sink, its rate [m^3/s] and the concentration [-] that it injects."""

    source_sink: SourceSink
    rate: float
    concentration: float


class SourcesAndSinks:
    """The sources and sinks of `physics`, distributed over its cells."""

    def __init__(self, physics: Physics) -> None:
        """List the wells and leaks of `physics`, each place once."""
        self.physics = physics
        self.all = tuple(
            dict.fromkeys([*physics.wells.values(), *(leak.source_sink for leak in physics.leaks)])
        )

    def active(self, rates: WellRates) -> list[ActiveSource]:
        """Return the sources and sinks whose rate is not zero.

        The rates of wells are those of `Physics.delivered`. Leaks are included.

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        physics = self.physics
        active = [
            ActiveSource(physics.wells[name], rate, rates[name].concentration)
            for name, rate in physics.delivered(rates).items()
            if rate != 0.0
        ]
        active.extend(
            ActiveSource(leak.source_sink, leak.rate, 0.0)
            for leak in physics.leaks
            if leak.rate != 0.0
        )
        return active

    def sources(self, rates: WellRates) -> Sources:
        """Return the water and tracer that wells and leaks add to every cell [m^3/s].

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        shape = self.physics.grid.shape
        inflow, tracer, outflow = (np.zeros(shape) for _ in range(3))
        for source_sink, rate, concentration in self.active(rates):
            cells, fractions = self._fractions_of(source_sink)
            if rate > 0:
                inflow.ravel()[cells] += rate * fractions
                tracer.ravel()[cells] += rate * concentration * fractions
            else:
                outflow.ravel()[cells] -= rate * fractions
        return Sources(inflow, tracer, outflow)

    def disc_mean(self, source_sink: SourceSink, field: FloatArray) -> float:
        """Return the mean of `field` (nz, nx) over the disc of `source_sink`, in its unit."""
        cells, fractions = self._fractions_of(source_sink)
        return float(fractions @ field.ravel()[cells])

    def _fractions_of(self, source_sink: SourceSink) -> tuple[CellArray, FloatArray]:
        return disc_fractions(self.physics.grid, source_sink.x, source_sink.z, source_sink.radius)
