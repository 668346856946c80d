"""The model of the paper's equations with one implicit step per interval (paper, section 2.2).

With the upwind fluxes q and one backward Euler step,

    phi d A (c^(n+1) - c^n) / dt + div(q c^(n+1)) = f_c + d A sigma,

which is L c = f_c + sigma with a linear operator L. So sigma is a source inside the equations: it
is transported within the step, where the other schemes add it after the step.
"""

from collections import OrderedDict
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import SuperLU, splu

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRates
from porotwin_solver.model.model import Model, validated_duration
from porotwin_solver.transport.sources_and_sinks import with_water

FACTORS_KEPT = 8
"""Factorised steps that are kept: experiments have few different rates."""


class ImplicitStep(NamedTuple):
    """One step as M c^(n+1) = storage c^n / dt + tracer + volume sigma, in m^3/s.

    `factor` solves with M; `storage` and `tracer` are (nz, nx).
    """

    factor: SuperLU
    matrix: csc_matrix
    storage: FloatArray
    tracer: FloatArray


class ImplicitModel(Model):
    """A model whose operator L is one implicit upwind step, linear in the concentration."""

    _steps: 'OrderedDict[tuple[object, ...], ImplicitStep]'

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the solution of L c = f_c, (nz, nx), `time_step` [s] after `concentration`.

        Raises:
            InputError: as `Model.predict`, or the tracer changes the flow or spreads.
        """
        start = self.validated_map(concentration, 'concentration')
        return self._solved(start, np.zeros(self.grid.shape), rates, time_step)

    def residual(
        self, previous: FloatArray, next_: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return r = L c - f_c [1/s], (nz, nx), of an observed pair of maps.

        Raises:
            InputError: as `predict`.
        """
        start, end = (self.validated_map(values, 'map') for values in (previous, next_))
        step = self._step(rates, time_step)
        applied = (step.matrix @ end.ravel()).reshape(self.grid.shape)
        known = step.storage * start / time_step + step.tracer
        residual: FloatArray = (applied - known) / self.physics.volume
        return residual

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return the solution of L c = f_c + sigma, (nz, nx); not clipped.

        Raises:
            InputError: as `predict`.
        """
        start, source = (self.validated_map(values, 'map') for values in (previous, sigma))
        return self._solved(start, source, rates, time_step)

    def step_adjoint(
        self, previous: FloatArray, rates: WellRates, time_step: float, bar: FloatArray
    ) -> FloatArray:
        """Return dJ/dprevious (nz, nx) of a cost J with `bar` = dJ/d(prediction) (nz, nx).

        The step of `time_step` [s] is linear, so that `previous` does not matter.

        Raises:
            InputError: as `predict`.
        """
        del previous
        step = self._step(rates, time_step)
        back = step.factor.solve(bar.ravel(), trans='T').reshape(self.grid.shape)
        by_previous: FloatArray = step.storage * back / time_step
        return by_previous

    def source_of(self, change: FloatArray, time_step: float) -> FloatArray:
        """Return the sigma (nz, nx) [1/s] that adds `change` (nz, nx) [-] without any flow."""
        source: FloatArray = self.engine.storage * change / (self.physics.volume * time_step)
        return source

    def _solved(
        self, start: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        step = self._step(rates, time_step)
        right = step.storage * start / time_step + step.tracer + self.physics.volume * sigma
        solved: FloatArray = step.factor.solve(right.ravel()).reshape(self.grid.shape)
        return solved

    def _step(self, rates: WellRates, time_step: float) -> ImplicitStep:
        if not hasattr(self, '_steps'):
            self._steps = OrderedDict()
        key = (*rates.items(), validated_duration(time_step, 'time step'))
        if key not in self._steps:
            self._steps[key] = self._factorised(rates, time_step)
            if len(self._steps) > FACTORS_KEPT:
                self._steps.popitem(last=False)
        return self._steps[key]

    def _factorised(self, rates: WellRates, time_step: float) -> ImplicitStep:
        physics, engine = self.physics, self.engine
        if physics.is_coupled or physics.disperses or physics.immobile_fraction:
            raise InputError(
                "preset 'implicit': knows the paper's equations only, without density, viscosity, "
                "dispersion or immobile water; use preset 'upwind'"
            )
        flux = engine.water_flux(rates)
        own = engine.sources_and_sinks.sources(rates)
        sources = with_water(physics, engine.contact(rates), flux, own)
        storage = engine.storage
        right, up = flux.x[:, 1:-1], flux.z[1:-1]
        outflow = storage / time_step + sources.outflow
        outflow = outflow + np.maximum(flux.x[:, 1:], 0.0) + np.maximum(-flux.x[:, :-1], 0.0)
        outflow = outflow + np.maximum(flux.z[1:], 0.0) + np.maximum(-flux.z[:-1], 0.0)
        outflow = outflow + physics.decay_rate * storage
        across = np.zeros(self.grid.shape)
        across[:, :-1] = np.maximum(right, 0.0)
        back = np.zeros(self.grid.shape)
        back[:, :-1] = np.maximum(-right, 0.0)
        size, columns = storage.size, self.grid.nx
        matrix = csc_matrix(
            diags(
                [
                    outflow.ravel(),
                    -across.ravel()[:-1],
                    -back.ravel()[:-1],
                    -np.maximum(up, 0.0).ravel(),
                    -np.maximum(-up, 0.0).ravel(),
                ],
                offsets=[0, -1, 1, -columns, columns],
                shape=(size, size),
            )
        )
        return ImplicitStep(splu(matrix), matrix, storage, sources.tracer)
