"""Transport of the virtual rig against exact solutions, conservation and the maximum principle."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_examples import make_rig, rates
from scipy.integrate import cumulative_trapezoid

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rig import EffectDescription, Rig
from porotwin_rig.characteristics import Carrier, arriving, inflow_through_rim
from porotwin_rig.mesh import Mesh
from porotwin_rig.spreading import Spreading, spread
from porotwin_rig.virtual_rig import VirtualRig

PORE_DEPTH = 0.375 * 0.010


def run(rig: VirtualRig, seconds: float, interval: float = 30.0) -> None:
    for _ in range(round(seconds / interval)):
        rig.advance(interval)


def wide_rig(spacing: float) -> Rig:
    """Return a rig so wide that its walls hardly matter for a doublet of `spacing` [m]."""
    return make_rig(
        width_m=12 * spacing,
        height_m=10 * spacing,
        wells={
            'injector': {'x_m': 5.5 * spacing, 'z_m': 5 * spacing, 'radius_m': 0.002},
            'producer': {'x_m': 6.5 * spacing, 'z_m': 5 * spacing, 'radius_m': 0.002},
        },
        control=None,
        boundaries={'top': 'closed'},
    )


def test_front_of_one_injector_is_a_circle_of_the_injected_volume() -> None:
    sides = dict.fromkeys(('top', 'bottom', 'left', 'right'), 'open')
    wells = {'injector': {'x_m': 0.251, 'z_m': 0.249}}
    rig = make_rig(width_m=0.5, height_m=0.5, control=None, wells=wells, boundaries=sides)
    asset = VirtualRig(rig, cell=0.002)
    asset.set_rates(rates(injector=(500.0, 1.0)))
    run(asset, 300.0)
    grid = rig.grid(500, 500)
    field = asset.concentration(grid)
    distance = np.hypot(grid.x[None, :] - 0.251, grid.z[:, None] - 0.249)
    radius = math.sqrt(from_ml_h(500.0) * 300.0 / (math.pi * PORE_DEPTH))
    front = 4.0 * math.sqrt(2 * 1e-9 * 300.0) + 0.002
    assert field[distance < radius - front].min() > 0.995
    assert field[distance > radius + front].max() < 0.005
    assert (field > 0.5).sum() * grid.cell_area == pytest.approx(math.pi * radius**2, rel=0.01)


@pytest.mark.parametrize('cell', [0.007, 0.01])
def test_a_well_in_the_middle_of_the_rig_makes_the_plume_of_one_beside_it(cell: float) -> None:
    fields = []
    for aside in (0.0, 1e-6):
        wells = {'injector': {'x_m': 0.467 + aside, 'z_m': 0.281 + aside}}
        asset = VirtualRig(make_rig(control=None, wells=wells), cell=cell)
        asset.set_rates(rates(injector=(500.0, 1.0)))
        run(asset, 120.0)
        fields.append(asset.visible())
    np.testing.assert_allclose(fields[0], fields[1], atol=2e-3)


def doublet_arrivals(spacing: float, rate: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Return first arrival [s], times and produced fractions of a doublet in the plane.

    The streamline that leaves at the angle t from the line between the wells arrives after
    3 t_b (1 - t cot t) / sin^2 t, t_b = pi phi depth L^2 / (3 Q) (Grove & Beetem 1971).
    """
    first = math.pi * PORE_DEPTH * spacing**2 / (3.0 * rate)
    angle = np.linspace(1e-3, 0.7 * math.pi, 2000)
    times = 3.0 * first * (1.0 - angle / np.tan(angle)) / np.sin(angle) ** 2
    return first, times, angle / math.pi


@pytest.mark.slow
def test_doublet_breaks_through_when_the_fastest_streamline_arrives() -> None:
    spacing, rate = 0.12, from_ml_h(500.0)
    first, times, fraction = doublet_arrivals(spacing, rate)
    asset = VirtualRig(wide_rig(spacing), cell=0.0035)
    asset.set_rates(rates(injector=(500.0, 1.0), producer=-500.0))
    step, produced = first / 15.0, [0.0]
    for _ in range(30):
        asset.advance(step)
        produced.append(asset.balance.removed)
    produced_at = step * np.arange(31)
    fine = np.linspace(0.0, produced_at[-1], 20001)
    arriving_now = rate * np.interp(fine, times, fraction, left=0.0)
    exact = np.interp(produced_at, fine, cumulative_trapezoid(arriving_now, fine, initial=0.0))
    assert np.interp(0.93 * first, produced_at, produced) < 2e-3 * rate * first
    assert produced[-1] == pytest.approx(exact[-1], rel=0.03)
    assert np.abs(np.array(produced) - exact).max() < 0.02 * rate * first


def test_water_that_passes_a_well_enters_it_on_the_side_it_comes_from() -> None:
    passing, rate, radius, points = 2e-7, 1.5e-8, 0.004, 720  # [m^2/s], [m^3/s], [m]
    carrier = Carrier(
        hx=0.01,
        hz=0.01,
        remainder_x=np.full((21, 22), passing),
        remainder_z=np.zeros((22, 21)),
        storage=np.full((21, 21), PORE_DEPTH),
        wells=np.array([[0.1, 0.1, radius, -rate, 0.0]]),
        entering=np.zeros((21, 21)),
        canal=np.zeros((21, 21), bool),
        settling=0.0,
    )
    angle = (np.arange(points) + 0.5) * (2.0 * math.pi / points)
    inflow = inflow_through_rim(carrier, 0.1, 0.1, radius, angle) * 2.0 * math.pi * radius / points
    assert inflow.sum() == pytest.approx(rate)
    upstream = inflow[np.cos(angle) < 0.0].sum()
    assert upstream == pytest.approx(0.5 * rate + 2.0 * radius * passing, rel=1e-4)


@given(
    control=st.lists(st.floats(0.0, 300.0), min_size=3, max_size=3),
    tracer=st.floats(0.05, 1.0),
    producer=st.floats(-900.0, 0.0),
)
@settings(max_examples=8)
def test_tracer_is_conserved_and_stays_within_its_bounds(
    control: list[float], tracer: float, producer: float
) -> None:
    asset = VirtualRig(make_rig(), cell=0.008)
    for turn in (control, control[::-1]):
        asset.set_rates(
            rates(
                injector=(500.0, tracer),
                control1=turn[0],
                control2=turn[1],
                control3=turn[2],
                producer=producer,
            )
        )
        run(asset, 900.0, 90.0)
        field = asset.visible()
        assert field.min() >= 0.0
        assert field.max() <= tracer * (1.0 + 1e-6)
    balance = asset.balance.injected - asset.balance.removed - asset.total_mass()
    assert abs(balance) < 1e-12 * asset.balance.injected
    assert asset.balance.injected == pytest.approx(from_ml_h(500.0) * tracer * 1800.0)


def test_tracer_fades_by_its_age_however_long_the_steps_are() -> None:
    fields = []
    for step in (1200.0, 30.0):
        fades = EffectDescription(name='decay', parameters={'rate': 3e-4})
        asset = VirtualRig(make_rig(), effects=[fades], cell=0.008)
        asset.set_rates(rates(injector=(500.0, 1.0), producer=-500.0))
        run(asset, 1200.0, step)
        fields.append(asset.visible())
    np.testing.assert_allclose(fields[0], fields[1], atol=1e-9)
    assert fields[0].max() > 0.98
    assert fields[0][fields[0] > 0.5].min() < 0.75  # the oldest tracer, exp(-0.36) = 0.70


def test_correction_of_the_mass_is_small_beside_what_was_injected() -> None:
    asset = VirtualRig(make_rig())
    asset.set_rates(rates(injector=(500.0, 1.0), control1=250.0, producer=-750.0))
    run(asset, 900.0)
    assert asset.balance.corrected < 3e-3 * asset.balance.injected


def coarse_rig(rate_ml_h: float) -> VirtualRig:
    """Return a rig on elements of 12.5 mm with a well of 2 mm in the middle of an element."""
    wells = {
        'injector': {'x_m': 0.25625, 'z_m': 0.25625, 'radius_m': 0.002},
        'producer': {'x_m': 0.7, 'z_m': 0.25, 'radius_m': 0.002},
    }
    rig = make_rig(control=None, wells=wells, boundaries={'top': 'closed'})
    asset = VirtualRig(rig, cell=0.0125)
    asset.set_rates(rates(injector=(rate_ml_h, 1.0), producer=-rate_ml_h))
    return asset


def test_plume_smaller_than_an_element_stays_at_its_well() -> None:
    asset = coarse_rig(5.0)
    run(asset, 180.0, 15.0)
    seen = asset.visible()
    assert (seen > 0.5 * seen.max()).sum() == 4
    assert np.sort(seen.ravel())[-5] < 0.1 * seen.max()
    assert asset.total_mass() == pytest.approx(from_ml_h(5.0) * 180.0)


def test_paths_do_not_jump_over_a_well_narrower_than_an_element() -> None:
    asset = coarse_rig(600.0)
    run(asset, 300.0)
    assert asset.balance.corrected < 0.05 * asset.balance.injected
    assert asset.visible().max() == pytest.approx(1.0, abs=1e-3)


def test_reporting_grid_keeps_the_mass() -> None:
    asset = VirtualRig(make_rig(), cell=0.006)
    asset.set_rates(rates(injector=(500.0, 1.0), producer=-500.0))
    run(asset, 300.0)
    for nx, nz in ((187, 112), (31, 44)):
        grid = asset.rig.grid(nx, nz)
        volume = float(asset.concentration(grid).sum()) * grid.cell_area * PORE_DEPTH
        assert volume == pytest.approx(asset.total_mass(), rel=1e-12)


def test_resting_water_only_diffuses() -> None:
    asset = VirtualRig(make_rig(), cell=0.004)
    asset.set_rates(rates(injector=(500.0, 1.0), producer=-500.0))
    run(asset, 300.0)
    before = asset.visible().copy()
    asset.set_rates({})
    asset.advance(1e-3)
    assert np.abs(asset.visible() - before).max() < 1e-6
    asset.advance(3600.0)
    assert asset.total_mass() == pytest.approx(asset.balance.injected)
    assert asset.visible().max() < 1.0 + 1e-5


def test_uniform_flow_shifts_a_plume_without_smearing_it() -> None:
    mesh = Mesh(299, 179, 0.9, 0.54)
    shape = mesh.shape
    speed, step, steps = 5e-5, 30.0, 100
    carrier = Carrier(
        mesh.hx,
        mesh.hz,
        np.full((shape[0], shape[1] + 1), speed),
        np.zeros((shape[0] + 1, shape[1])),
        np.ones(shape),
        np.zeros((0, 5)),
        np.zeros(shape),
        np.zeros(shape, bool),
        settling=0.0,
    )
    x, z = np.meshgrid(mesh.x, mesh.z)

    def plume(centre: float) -> np.ndarray:
        return 0.5 * (1 - np.tanh((np.hypot(x - centre, z - 0.27) - 0.12) / 0.004))

    field = plume(0.25)
    for _ in range(steps):
        field, low, high = arriving(carrier, field, x=x, z=z, duration=np.full(shape, step))
        assert (low - 1e-12 <= field).all()
        assert (field <= high + 1e-12).all()
    exact = plume(0.25 + speed * step * steps)
    assert np.linalg.norm(field - exact) / np.linalg.norm(exact) < 0.02


def test_finer_mesh_changes_the_reported_map_by_less_than_two_percent() -> None:
    wells = {'injector': {'x_m': 0.13, 'z_m': 0.12}, 'control1': {'x_m': 0.21, 'z_m': 0.17}}
    wells['producer'] = {'x_m': 0.26, 'z_m': 0.05}
    rig = make_rig(width_m=0.32, height_m=0.25, control=None, wells=wells)
    maps = []
    for cell in (0.0021, 0.0011):
        asset = VirtualRig(rig, cell=cell)
        asset.set_rates(rates(injector=(500.0, 1.0), control1=300.0, producer=-800.0))
        run(asset, 300.0)
        maps.append(asset.concentration(asset.rig.default_grid()))
    assert np.linalg.norm(maps[0] - maps[1]) / np.linalg.norm(maps[1]) < 0.02


def test_dispersion_tensor_widens_a_spot_along_and_across_the_flow_as_einstein_says() -> None:
    mesh = Mesh(149, 149, 0.6, 0.6)
    x, z = np.meshgrid(mesh.x - 0.3, mesh.z - 0.3)
    spot = np.exp(-0.5 * (x**2 + z**2) / 0.02**2)
    speed, angle = 1e-4, math.radians(30.0)
    spreading = Spreading(1e-9, longitudinal=5e-3, transverse=5e-4)
    storage = np.full(mesh.shape, 0.004)
    later = spread(
        mesh,
        spot,
        storage=storage,
        spreading=spreading,
        velocity=(
            np.full(mesh.shape, speed * math.cos(angle)),
            np.full(mesh.shape, speed * math.sin(angle)),
        ),
        duration=400.0,
    )
    along, across = (
        x * math.cos(angle) + z * math.sin(angle),
        z * math.cos(angle) - x * math.sin(angle),
    )

    def variance(field: np.ndarray, axis: np.ndarray) -> float:
        weight = field * mesh.box_area
        return float((weight * axis**2).sum() / weight.sum())

    assert float((later * mesh.box_area).sum()) == pytest.approx(
        float((spot * mesh.box_area).sum())
    )
    for axis, dispersivity in ((along, 5e-3), (across, 5e-4)):
        widened = variance(later, axis) - variance(spot, axis)
        assert widened == pytest.approx(2 * (dispersivity * speed + 1e-9) * 400.0, rel=0.01)


def test_water_from_the_open_top_brings_no_tracer() -> None:
    asset = VirtualRig(make_rig(), cell=0.006)
    asset.set_rates(rates(injector=(500.0, 1.0)))
    run(asset, 600.0, 60.0)
    held = asset.total_mass()
    asset.set_rates(rates(producer=-500.0))
    run(asset, 600.0, 60.0)
    assert asset.total_mass() <= held * (1 + 1e-12)


def test_closed_rig_takes_out_what_is_put_in() -> None:
    asset = VirtualRig(make_rig(boundaries={'top': 'closed'}), cell=0.008)
    asset.set_rates(rates(injector=(500.0, 1.0), producer=-300.0))
    run(asset, 600.0, 60.0)
    assert asset.balance.injected == pytest.approx(from_ml_h(500.0) * 600.0)
    assert asset.visible().max() <= 1.0 + 1e-9
    assert asset.measured_rates()['producer'].rate == pytest.approx(from_ml_h(-300.0))


def test_disc_of_a_well_fills_in_the_time_its_pores_take() -> None:
    wells = {'injector': {'x_m': 0.08, 'z_m': 0.08}}
    rig = make_rig(width_m=0.16, height_m=0.16, control=None, wells=wells)
    asset = VirtualRig(rig, cell=0.001)
    asset.set_rates(rates(injector=(500.0, 1.0)))
    asset.advance(1.0)
    exchange = from_ml_h(500.0) / (math.pi * 0.004**2 * PORE_DEPTH)
    centre = asset.concentration(rig.grid(159, 159))[79, 79]
    assert centre == pytest.approx(1.0 - math.exp(-exchange), abs=0.01)


def test_case_effects_do_not_leak_between_rigs() -> None:
    commanded = rates(injector=(500.0, 1.0), producer=-500.0)
    plain, again = VirtualRig(make_rig(), cell=0.01), VirtualRig(make_rig(), cell=0.01)
    other = VirtualRig(
        make_rig(),
        cell=0.01,
        effects=[EffectDescription(name='decay', parameters={'rate': 1e-3})],
    )
    for asset in (plain, other, again):
        asset.set_rates(commanded)
        run(asset, 300.0)
    np.testing.assert_array_equal(plain.visible(), again.visible())
    assert other.total_mass() < plain.total_mass()
