"""The adjoint of advection: the dot-product test."""

import numpy as np
import pytest

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRate
from porotwin_solver.adjoint.transport_adjoint_kernels import (
    AdvectionDerivatives,
    advection_adjoint,
)
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.model.engine import Engine
from porotwin_solver.transport.scheme import Scheme
from porotwin_solver.transport.transport import (
    AdvectionTape,
    FluxAccumulators,
    Sources,
    advect,
    advection_levels,
)


@pytest.mark.parametrize('scheme', list(Scheme))
def test_advection_and_its_adjoint_pass_the_dot_product_test(rig, rates, scheme) -> None:
    """<bar, dP/du u'> = <dP/du^T bar, u'> for all inputs of one step at once."""
    physics = nominal_physics(rig, rig.grid(31, 19))
    engine = Engine(physics, scheme=scheme)
    rng = np.random.default_rng(7)
    start = 0.2 + 0.6 * rng.random(physics.grid.shape)
    flux, storage = engine.water_flux(rates), physics.storage
    sources = engine.sources_and_sinks.sources(rates)
    levels = advection_levels(flux, sources, storage, 30.0)
    direction = {
        'c': rng.normal(size=start.shape),
        'flux': engine.water_flux({'control1': WellRate(1e-7), 'producer': WellRate(-3e-8)}),
        'inflow': sources.inflow * rng.random(start.shape),
        'tracer': sources.tracer * rng.random(start.shape),
        'outflow': sources.outflow * rng.random(start.shape),
        'storage': storage * rng.normal(size=start.shape),
    }

    def run(size: float) -> tuple[FloatArray, AdvectionTape]:
        c = start + size * direction['c']
        tape = advect(
            c,
            flux + direction['flux'] * size,
            sources=Sources(
                *(
                    getattr(sources, name) + size * direction[name]
                    for name in ('inflow', 'tracer', 'outflow')
                )
            ),
            storage=storage + size * direction['storage'],
            levels=levels,
            scheme=scheme,
            accumulators=FluxAccumulators.zeros(physics.grid),
            record=True,
        )
        assert tape is not None
        return c, tape

    bar = rng.normal(size=start.shape)
    size = 1e-7
    forward = np.vdot(bar, (run(size)[0] - run(-size)[0]) / (2.0 * size))
    after, tape = run(0.0)
    back = bar.copy()
    by_flux = FaceField.zeros(physics.grid)
    by = {name: np.zeros(start.shape) for name in ('inflow', 'tracer', 'outflow', 'storage')}
    derivatives = AdvectionDerivatives(
        by_flux, Sources(by['inflow'], by['tracer'], by['outflow']), by['storage']
    )
    advection_adjoint(after, back, flux, sources, storage, levels, int(scheme), tape, derivatives)
    np.testing.assert_array_equal(after, start)  # read back from the tape
    backward = np.vdot(back, direction['c'])
    backward += np.vdot(by_flux.x, direction['flux'].x) + np.vdot(by_flux.z, direction['flux'].z)
    backward += sum(np.vdot(by[name], direction[name]) for name in by)
    assert backward == pytest.approx(forward, rel=1e-5)
