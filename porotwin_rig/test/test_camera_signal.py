"""The signal of the camera: effects of the camera follow their conventions."""

import numpy as np
import pytest
from rig_examples import make_rig, rates

from porotwin_rig.camera_signal import signal_seen
from porotwin_rig.effects import parse_effects
from porotwin_rig.virtual_rig import VirtualRig

COMMANDED = rates(injector=(500.0, 0.8), producer=-500.0)


def seen(*effects: str, time: float = 600.0) -> tuple[np.ndarray, VirtualRig]:
    asset = VirtualRig(make_rig(), effects=parse_effects(';'.join(effects)), cell=0.006)
    asset.set_rates(COMMANDED)
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
