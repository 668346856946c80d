"""The model compared with exact solutions, and its rates of convergence.

An error is the L1 norm of the difference divided by the L1 norm of the exact map, unless stated
otherwise. A rate is the slope of log(error) over log(cell size) from the coarsest to the finest
grid.
"""

import math

import exact_solutions
import numpy as np
import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import Boundaries, EffectDescription, Well
from porotwin_solver.coefficients.discs import radial_front
from porotwin_solver.effects import described_physics
from porotwin_solver.model.coupling import Coupling
from porotwin_solver.model.engine import State
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate

OPEN = Boundaries(top='open', bottom='open', left='open', right='open')
NO_DIFFUSION = EffectDescription(
    name='dispersion',
    parameters={
        'longitudinal_dispersivity': 0.0,
        'transverse_dispersivity': 0.0,
        'diffusion': 0.0,
    },
)


def rate_of_convergence(cells: list[int], errors: list[float]) -> float:
    """Return the slope of log(error) over log(cell size)."""
    return math.log(errors[0] / errors[-1]) / math.log(cells[-1] / cells[0])


def supersampled(function, grid: Grid, parts: int = 8) -> FloatArray:
    """Return the cell means of a function of x and z, from parts x parts points in each cell."""
    fine = grid.refined(parts)
    values = function(fine.x[None, :], fine.z[:, None])
    return values.reshape(grid.nz, parts, grid.nx, parts).mean(axis=(1, 3))


def square_rig(make_rig, **changes):
    """Return a homogeneous square rig with a well in the middle."""
    return make_rig(
        width_m=1.0,
        height_m=1.0,
        boundaries=OPEN,
        wells={'well': Well(x_m=0.5, z_m=0.5)},
        **changes,
    )


@pytest.mark.parametrize(
    ('preset', 'slope', 'finest'),
    [('fast', 0.7, 0.03), ('accurate', 0.45, 0.014), ('upwind', 0.4, 0.13)],
)
def test_the_front_of_a_single_injector_is_a_circle(make_rig, preset, slope, finest) -> None:
    rig = square_rig(make_rig)
    time, rate = 1800.0, from_ml_h(500.0)
    radius = radial_front(rate * time, thickness=0.010 * 0.375)
    # grids that the accurate preset refines by the same factor
    cells = [20, 40, 80] if preset == 'accurate' else [50, 100, 200]
    errors = []  # at a jump a scheme of order p has order p / (p + 1) in L1
    for count in cells:
        grid = rig.grid(count, count)
        found = simulate(
            rig,
            Schedule.constant({'well': WellRate(rate, 1.0)}),
            [time],
            grid=grid,
            preset=preset,
            effects=[NO_DIFFUSION],
        )[0]
        circle = supersampled(lambda x, z: 1.0 * (np.hypot(x - 0.5, z - 0.5) < radius), grid)
        errors.append(np.abs(found - circle).sum() / circle.sum())
    observed = rate_of_convergence(cells, errors)
    print(f'radial front, {preset}: errors {errors}, rate {observed:.2f}')
    assert observed > slope
    assert errors[-1] < finest


@pytest.mark.parametrize(('preset', 'slope'), [('fast', 1.5), ('accurate', 1.8), ('upwind', 0.8)])
def test_a_flushed_column_follows_ogata_and_banks(make_rig, preset, slope) -> None:
    rig = make_rig(width_m=1.0, height_m=0.1, boundaries=Boundaries(top='closed'), wells={})
    darcy, dispersivity, time = 2e-5, 0.02, 7000.0
    velocity = darcy / 0.375
    effects = [
        EffectDescription(
            name='dispersion',
            parameters={
                'longitudinal_dispersivity': dispersivity,
                'transverse_dispersivity': 0.1 * dispersivity,
                'diffusion': 0.0,
            },
        ),
        EffectDescription(name='background_flow', parameters={'x_velocity': darcy}),
    ]
    cells, errors = [10, 20, 40] if preset == 'accurate' else [25, 50, 100], []
    for count in cells:
        grid = rig.grid(count, 2)
        found = simulate(
            rig,
            Schedule(),
            [time],
            grid=grid,
            preset=preset,
            effects=effects,
            initial=np.ones(grid.shape),
        )[0]
        clean = exact_solutions.advancing_front(
            grid.refined(8).x, time, velocity=velocity, diffusion=dispersivity * velocity
        )
        expected = 1.0 - clean.reshape(count, 8).mean(axis=1)
        upstream = grid.x < 0.7  # the exact column has no end
        errors.append(np.abs(found[0] - expected)[upstream].sum() / expected[upstream].sum())
        np.testing.assert_allclose(found[0], found[1], atol=1e-12)
    observed = rate_of_convergence(cells, errors)
    print(f'Ogata-Banks, {preset}: errors {errors}, rate {observed:.2f}')
    assert observed > slope


def test_radial_dispersion_follows_chen(make_rig) -> None:
    rig = square_rig(make_rig)
    time, rate, dispersivity = 1500.0, from_ml_h(500.0), 0.008
    strength = rate / (2.0 * math.pi * 0.010 * 0.375)
    effects = [
        EffectDescription(
            name='dispersion',
            parameters={
                'longitudinal_dispersivity': dispersivity,
                'transverse_dispersivity': 0.1 * dispersivity,
                'diffusion': 0.0,
            },
        )
    ]
    cells, errors = [40, 80, 160], []
    for count in cells:
        grid = rig.grid(count, count)
        found = simulate(
            rig,
            Schedule.constant({'well': WellRate(rate, 1.0)}),
            [time],
            grid=grid,
            preset='fast',
            effects=effects,
        )[0]
        radius = np.hypot(grid.x[None, :] - 0.5, grid.z[:, None] - 0.5)
        ring = (radius > 0.03) & (radius < 0.25)
        expected = exact_solutions.radial_dispersion(
            radius[ring], time, strength=strength, dispersivity=dispersivity, well=0.004
        )
        errors.append(np.abs(found[ring] - expected).sum() / expected.sum())
    observed = rate_of_convergence(cells, errors)
    print(f'radial dispersion: errors {errors}, rate {observed:.2f}')
    assert observed > 0.9
    assert errors[-1] < 0.02


def doublet_production(make_rig, side: str, count: int) -> tuple[float, float]:
    """Return the production at 0.9 and 2 breakthrough times, in rate times breakthrough time."""
    rig = make_rig(
        width_m=1.6,
        height_m=1.6,
        boundaries=Boundaries(top=side, bottom=side, left=side, right=side),
        wells={'source': Well(x_m=0.72, z_m=0.8), 'sink': Well(x_m=0.88, z_m=0.8)},
    )
    rate = from_ml_h(500.0)
    rates = {'source': WellRate(rate, 1.0), 'sink': WellRate(-rate)}
    breakthrough = exact_solutions.doublet_breakthrough(
        rate, distance=0.16, thickness=0.010 * 0.375
    )
    model = Model(rig, rig.grid(count, count), preset='fast', effects=[NO_DIFFUSION])
    state = State.equilibrium(model.initial_condition())
    model.engine.advance(state, rates, 0.9 * breakthrough)
    early = state.tracer_lost[0] / (rate * breakthrough)
    model.engine.advance(state, rates, 1.1 * breakthrough)
    return early, state.tracer_lost[0] / (rate * breakthrough)


def test_a_doublet_follows_theory_in_breakthrough_and_production(make_rig) -> None:
    """Distant sides, open and closed: the errors of their image wells have opposite signs."""
    cells, errors, early = [80, 160], [], []
    for count in cells:
        found = [doublet_production(make_rig, side, count) for side in ('open', 'closed')]
        early.append(max(before for before, _ in found))
        mean = sum(after for _, after in found) / 2.0
        errors.append(abs(mean / exact_solutions.doublet_produced(2.0) - 1.0))
    observed = rate_of_convergence(cells, errors)
    print(
        f'doublet: produced too early {early}, errors of production {errors}, rate {observed:.2f}'
    )
    assert early[-1] < 0.0005
    assert errors[-1] < 0.005
    assert observed > 0.8


def test_retardation_scales_time(rig, rates) -> None:
    grid = rig.grid(47, 28)
    retarded = [
        EffectDescription(name='retardation', parameters={'retardation_factor': 1.6}),
        NO_DIFFUSION,
    ]
    plain = Model(rig, grid, preset='fast', effects=[NO_DIFFUSION])
    slow = Model(rig, grid, preset='fast', effects=retarded)
    empty = plain.initial_condition()
    np.testing.assert_allclose(
        slow.predict(empty, rates, 48.0), plain.predict(empty, rates, 30.0), atol=1e-12
    )


def test_decay_without_flow_is_exponential(rig) -> None:
    grid = rig.grid(47, 28)
    decay = EffectDescription(name='decay', parameters={'rate': 2e-4})
    model = Model(rig, grid, preset='accurate', effects=[decay, NO_DIFFUSION])
    start = np.random.default_rng(7).random(grid.shape)
    np.testing.assert_allclose(model.predict(start, {}, 900.0), start * math.exp(-0.18), rtol=1e-12)


def test_exchange_with_immobile_water_follows_its_law(rig) -> None:
    """With d c_im / dt = w (c - c_im) and a constant mean, the gap decays exponentially."""
    dual = EffectDescription(
        name='dual_porosity', parameters={'immobile_fraction': 0.3, 'exchange_rate': 1e-3}
    )
    model = Model(rig, rig.grid(12, 7), preset='fast', effects=[dual, NO_DIFFUSION])
    state = State(np.ones((7, 12)), np.zeros((7, 12)))
    model.engine.advance(state, {}, 600.0)
    gap = math.exp(-1e-3 * 600.0 / 0.7)
    np.testing.assert_allclose(state.mobile - state.immobile, gap, rtol=1e-12)
    np.testing.assert_allclose(model.engine.mean_concentration(state), 0.7, rtol=1e-12)


def test_a_spreading_spot_follows_the_gaussian_in_any_direction(make_rig) -> None:
    """Anisotropic dispersion at an angle to the grid: the second moments grow as 2 D t."""
    rig = make_rig(width_m=1.0, height_m=1.0, boundaries=Boundaries(top='closed'), wells={})
    darcy = (2.0e-5, 1.1e-5)
    along, across, time = 0.01, 0.0008, 4000.0
    effects = [
        EffectDescription(
            name='background_flow',
            parameters={'x_velocity': darcy[0], 'z_velocity': darcy[1]},
        ),
        EffectDescription(
            name='dispersion',
            parameters={
                'longitudinal_dispersivity': along,
                'transverse_dispersivity': across,
                'diffusion': 0.0,
            },
        ),
    ]
    v = np.array(darcy) / 0.375
    speed = np.hypot(*v)
    spread = across * speed * np.eye(2) + (along - across) * np.outer(v, v) / speed
    errors, cells = [], [25, 100]
    first = 0.0016 * np.eye(2)
    last = first + 2.0 * spread * time

    def gaussian(x, z, moved, covariance):
        dx, dz = x - 0.3 - moved[0], z - 0.35 - moved[1]
        inverse = np.linalg.inv(covariance)
        power = inverse[0, 0] * dx**2 + 2 * inverse[0, 1] * dx * dz + inverse[1, 1] * dz**2
        return np.exp(-0.5 * power) / math.sqrt(np.linalg.det(covariance)) * 0.0016

    for count in cells:
        grid = rig.grid(count, count)
        start = supersampled(lambda x, z: gaussian(x, z, (0.0, 0.0), first), grid, 2)
        expected = supersampled(lambda x, z: gaussian(x, z, v * time, last), grid, 2)
        found = simulate(
            rig,
            Schedule(),
            [time],
            grid=grid,
            preset='accurate',
            effects=effects,
            initial=start,
        )[0]
        errors.append(np.linalg.norm(found - expected) / np.linalg.norm(expected))
    observed = rate_of_convergence(cells, errors)
    print(f'spreading spot: errors {errors}, rate {observed:.2f}')
    assert observed > 1.2  # the limiter cuts the peak
    assert errors[-1] < 0.02


def buoyant_flux(rig, grid: Grid, concentration: FloatArray):
    """Return the flux [m^3/s] that a density difference of 1 kg/m^3 drives."""
    heavy = EffectDescription(name='buoyancy', parameters={'density_difference': 1.0})
    physics = described_physics(rig, grid, [heavy])
    return Coupling(physics).flux({}, concentration)


def test_a_denser_layer_at_the_bottom_drives_no_flow(make_rig) -> None:
    rig = make_rig(boundaries=Boundaries(top='closed'))
    grid = rig.grid(47, 28)
    layer = np.repeat((grid.z < 0.2)[:, None] * 1.0, 47, axis=1)
    flux = buoyant_flux(rig, grid, layer)
    falling = 6.57e-10 / 1e-3 * 9.81 * 0.010 * grid.dx
    assert np.abs(flux.x).max() < 1e-12 * falling
    assert np.abs(flux.z).max() < 1e-12 * falling


def test_a_denser_blob_sinks_at_the_darcy_velocity(make_rig) -> None:
    rig = make_rig(width_m=1.0, height_m=1.0, boundaries=Boundaries(top='closed'), wells={})
    conductivity = 6.57e-10 * 9.81 / 1e-3
    expected = exact_solutions.sinking_blob(1.0, conductivity=conductivity)
    radius, errors = 0.06, []
    for count in (50, 200):
        grid = rig.grid(count, count)
        blob = supersampled(lambda x, z: 1.0 * (np.hypot(x - 0.5, z - 0.5) < radius), grid)
        flux = buoyant_flux(rig, grid, blob)
        inside = supersampled(lambda x, z: 1.0 * (np.hypot(x - 0.5, z - 0.5) < 0.05), grid) > 0.99
        falling = -0.5 * (flux.z[:-1] + flux.z[1:])[inside].mean() / (0.010 * grid.dx)
        # closed sides: the image blobs slow the middle one by about (radius / side)^2 pi
        errors.append(abs(falling / (expected * (1.0 - math.pi * radius**2)) - 1.0))
    print(f'sinking blob: errors {errors}')
    assert errors[-1] < 0.01


def test_a_denser_blob_moves_down_and_a_lighter_one_up(make_rig) -> None:
    rig = make_rig(boundaries=Boundaries(top='closed'))
    grid = rig.grid(47, 28)
    blob = 1.0 * (np.hypot(grid.x[None, :] - 0.45, grid.z[:, None] - 0.3) < 0.08)
    heights = []
    for difference in (2.0, 0.0, -2.0):
        effect = EffectDescription(name='buoyancy', parameters={'density_difference': difference})
        model = Model(rig, grid, preset='fast', effects=[effect])
        found = model.predict(blob, {}, 1800.0)
        heights.append(model.quantity_of_interest('plume_centroid_z', found))
    assert heights[0] < heights[1] - 0.01
    assert heights[2] > heights[1] + 0.01
