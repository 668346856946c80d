"""What the camera makes of the tracer: image effects by their conventions, noise by its figures."""

import numpy as np
import pytest
from rig_examples import make_rig, rates

from porotwin_rig.asset import VirtualRig
from porotwin_rig.effects import parse_effects
from porotwin_rig.observation import MapCamera, MapNoise, signal_seen

TOLD = rates(injector=(500.0, 0.8), producer=-500.0)


def seen(*effects: str, time: float = 600.0) -> tuple[np.ndarray, VirtualRig]:
    asset = VirtualRig(make_rig(), effects=parse_effects(';'.join(effects)), cell=0.006)
    asset.set_rates(TOLD)
    asset.advance(300.0)
    return signal_seen(asset, asset.rig.default_grid(), time=time), asset


def test_saturation_is_a_power_of_the_concentration() -> None:
    plain, _ = seen()
    bent, _ = seen('saturation:exponent=0.7')
    np.testing.assert_allclose(bent, plain**0.7, atol=1e-9)


def test_illumination_drifts_with_time_and_across_the_rig() -> None:
    plain, asset = seen()
    lit, _ = seen('illumination:drift=-1e-4,gradient=0.2', time=900.0)
    factor = 1.0 - 1e-4 * 900.0 + 0.2 * (asset.rig.default_grid().x - 0.467)
    np.testing.assert_allclose(lit, np.clip(plain * factor[None, :], 0, 1), atol=1e-9)


def test_registration_shows_a_point_where_the_convention_says() -> None:
    plain, asset = seen()
    moved, _ = seen('registration:dx=0.02,dz=-0.03,rotation=0.15,scale=1.1')
    grid = asset.rig.default_grid()

    def centre(field: np.ndarray) -> np.ndarray:
        total = field.sum()
        return np.array(
            [(field * grid.x[None, :]).sum() / total, (field * grid.z[:, None]).sum() / total]
        )

    middle = np.array([0.467, 0.281])
    turn = np.array([[np.cos(0.15), -np.sin(0.15)], [np.sin(0.15), np.cos(0.15)]])
    expected = middle + 1.1 * turn @ (centre(plain) - middle) + [0.02, -0.03]
    np.testing.assert_allclose(centre(moved), expected, atol=3e-4)
    assert moved.sum() == pytest.approx(1.1**2 * plain.sum(), rel=5e-3)


def test_reflection_climbs() -> None:
    text = 'reflection:x=0.7,z=0.1,radius=0.02,strength=0.5,climb=1e-4'
    early, asset = seen(text, time=0.0)
    late, _ = seen(text, time=2000.0)
    grid = asset.rig.default_grid()
    column = int(0.7 / grid.dx)
    assert grid.z[early[:, column].argmax()] == pytest.approx(0.1, abs=grid.dz)
    assert grid.z[late[:, column].argmax()] == pytest.approx(0.3, abs=grid.dz)


def test_map_noise_has_the_strength_it_says() -> None:
    grid = make_rig().default_grid()
    camera = MapCamera(grid, MapNoise(grain=0.0, frame=0.01, blur_cells=0.0), seed=3)
    field = np.full(grid.shape, 0.5)
    assert (camera.map(field, 1) - field).std() == pytest.approx(0.01 * 0.8, rel=0.02)
    grained = MapCamera(grid, MapNoise(grain=0.02, frame=0.0, blur_cells=0.0), seed=3)
    one, two = grained.map(field, 1), grained.map(field, 2)
    np.testing.assert_array_equal(one, two)
    assert (one - field).std() == pytest.approx(0.02 * 0.5, rel=0.02)


def test_noise_of_a_frame_depends_on_its_number_and_seed_alone() -> None:
    grid = make_rig().grid(40, 30)
    field = np.full(grid.shape, 0.5)
    camera = MapCamera(grid, MapNoise(), seed=3)
    fourth = camera.map(field, 4)
    camera.map(field, 2)
    np.testing.assert_array_equal(camera.map(field, 4), fourth)
    assert not np.array_equal(camera.map(field, 5), fourth)
    assert not np.array_equal(MapCamera(grid, MapNoise(), seed=4).map(field, 4), fourth)


def test_lost_frames_and_blind_spots() -> None:
    grid = make_rig().grid(60, 40)
    camera = MapCamera(grid, MapNoise(lost=0.3, patches=3), seed=5)
    lost = [camera.is_lost(n) for n in range(1000)]
    assert not lost[0]
    assert 0.25 < np.mean(lost) < 0.35
    blind = [np.isnan(camera.map(np.zeros(grid.shape), n)) for n in (0, 7)]
    assert 0.0 < blind[0].mean() < 0.3
    np.testing.assert_array_equal(blind[0], blind[1])
