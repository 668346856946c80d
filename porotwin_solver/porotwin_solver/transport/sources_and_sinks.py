"""Wells, leaks and water bodies on a grid: the water and tracer that they add to the cells."""

from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRates
from porotwin_solver.coefficients.discs import CellArray, disc_fractions
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics, SourceSink
from porotwin_solver.coefficients.water_contact import (
    Outline,
    WaterContact,
    entering,
    outer_flux,
)
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

        `Physics.injected` gives the rates of wells. Leaks are included.

        Raises:
            InputError: a rate for a well that the rig does not have.
        """
        physics = self.physics
        active = [
            ActiveSource(physics.wells[name], one.rate, one.concentration)
            for name, one in physics.injected(rates).items()
            if one.rate != 0.0
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

    def spread(self, source_sink: SourceSink) -> FloatArray:
        """Return a rate of 1 m^3/s into `source_sink`, over the cells (nz, nx)."""
        source = np.zeros(self.physics.grid.shape)
        cells, fractions = self._fractions_of(source_sink)
        source.ravel()[cells] = fractions
        return source

    def disc_mean(self, source_sink: SourceSink, field: FloatArray) -> float:
        """Return the mean of `field` (nz, nx) over the disc of `source_sink`, in its unit."""
        cells, fractions = self._fractions_of(source_sink)
        return float(fractions @ field.ravel()[cells])

    def _fractions_of(self, source_sink: SourceSink) -> tuple[CellArray, FloatArray]:
        return disc_fractions(self.physics.grid, source_sink.x, source_sink.z, source_sink.radius)


def with_water(
    physics: Physics, contact: WaterContact, flux: FaceField, sources: Sources
) -> Sources:
    """Return `sources` with the water of canals, and the tracer of all water that `flux` brings.

    `flux` [m^3/s] is through all faces. A canal adds or takes what does not balance in its cells.
    Diffusion through an outer face, over half a cell, is an exchange of water with the outside.
    """
    if contact.is_plain:
        return sources
    inflow, tracer, outflow = (part.copy() for part in sources)
    entered = entering(flux).map(
        lambda water, stock: stock * np.maximum(water, 0.0), contact.concentration
    )
    exchanged = _exchanged(physics, contact)
    both = -outer_flux(exchanged).divergence()
    inflow, outflow = inflow + both, outflow + both
    brought = entered.map(
        lambda tracer, water, stock: tracer + stock * water, exchanged, contact.concentration
    )
    tracer -= outer_flux(brought).divergence()
    if contact.canal is not None:
        net = np.where(contact.canal, flux.divergence() - sources.net, 0.0)
        inflow += np.maximum(net, 0.0)
        tracer += contact.canal_concentration * np.maximum(net, 0.0)
        outflow += np.maximum(-net, 0.0)
    return Sources(inflow, tracer, outflow)


def _exchanged(physics: Physics, contact: WaterContact) -> Outline:
    """Return the water that each outer face exchanges by diffusion, 2 D water / dx^2 [m^3/s]."""
    pores, grid = physics.mobile_water, physics.grid
    beside = Outline(pores[:, 0], pores[:, -1], pores[0], pores[-1])
    sizes = Outline(*(np.array(size) for size in (grid.dx, grid.dx, grid.dz, grid.dz)))
    diffusion = 2.0 * (physics.diffusion + physics.model_diffusion)
    return contact.diffuses.map(
        lambda share, water, size: share * diffusion * water / size**2, beside, sizes
    )


def with_water_adjoint(
    contact: WaterContact, flux: FaceField, bar: Sources, flux_bar: FaceField
) -> None:
    """Add to `flux_bar` the derivative by `flux` through the result of `with_water`.

    `bar` holds the derivatives by that result.
    """
    if contact.is_plain:
        return
    beside = Outline(bar.tracer[:, 0], bar.tracer[:, -1], bar.tracer[0], bar.tracer[-1])
    through = entering(flux).map(
        lambda water, stock, by: np.where(water > 0.0, stock * by, 0.0),
        contact.concentration,
        beside,
    )
    by_outer = outer_flux(through)
    flux_bar.x[:] += by_outer.x
    flux_bar.z[:] += by_outer.z
    if contact.canal is not None:
        net = flux.divergence()
        gain = bar.inflow + contact.canal_concentration * bar.tracer
        by_net = np.where(net > 0.0, gain, -bar.outflow) * contact.canal
        flux_bar.x[:, 1:] += by_net
        flux_bar.x[:, :-1] -= by_net
        flux_bar.z[1:] += by_net
        flux_bar.z[:-1] -= by_net
