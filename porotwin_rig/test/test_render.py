"""Rendered photographs: dye, lamps, camera and file."""

import io
from datetime import UTC, datetime

import cv2
import numpy as np
import pytest
from PIL import Image
from rig_examples import make_rig

from porotwin_core.basis.errors import InputError
from porotwin_rig.camera import camera_before
from porotwin_rig.render import Conditions, Photographer

STEADY = Conditions(light_drift=0.0, light_gradient=0.0, noise=0.0, shake_px=0.0, quality=98)


def taken(jpeg: bytes) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), float)


def photographer(conditions: Conditions = STEADY, seed: int = 9, width: int = 800) -> Photographer:
    rig = make_rig()
    camera = camera_before(rig, width, round(width * 0.625))
    return Photographer(rig, camera=camera, conditions=conditions, seed=seed)


@pytest.fixture(scope='module')
def steady() -> Photographer:
    return photographer()


def sand_pixels(steady: Photographer) -> np.ndarray:
    """Return which pixels show sand well inside the rig and away from the wells."""
    column, row = np.meshgrid(np.arange(800.0), np.arange(500.0))
    x, z = steady.camera.to_metres(column, row)
    inside = (x > 0.01) & (x < 0.924) & (z > 0.01) & (z < 0.552)
    for well in steady.rig.wells.values():
        inside &= np.hypot(x - well.x_m, z - well.z_m) > 0.01
    return inside


def test_dye_darkens_sand_monotonically_and_nearly_in_proportion(steady: Photographer) -> None:
    sand = sand_pixels(steady)
    shades = []
    for signal in (0.0, 0.25, 0.5, 0.75, 1.0):
        picture = taken(steady.photograph(np.full((5, 8), signal), time=0.0)) / 255.0
        linear = np.where(picture <= 0.04045, picture / 12.92, ((picture + 0.055) / 1.055) ** 2.4)
        shades.append(linear[sand].mean(axis=0))
    falls = np.diff(np.array(shades), axis=0)
    assert (falls < 0).all()
    response = (shades[0] - np.array(shades)) / (shades[0] - shades[-1])
    for channel in response.T:
        assert np.allclose(channel, np.linspace(0, 1, 5), atol=0.05)


def test_dye_colours_nothing_but_sand(steady: Photographer) -> None:
    column, row = np.meshgrid(np.arange(800.0), np.arange(500.0))
    x, z = steady.camera.to_metres(column, row)
    outside = (x < -0.01) | (x > 0.944) | (z < -0.01) | (z > 0.572)
    clean = taken(steady.photograph(np.zeros((4, 4)), time=0.0))
    full = taken(steady.photograph(np.ones((4, 4)), time=0.0))
    assert np.abs(clean - full)[outside].max() <= 6.0  # JPEG's blocks across the edge


def test_tracer_is_seen_where_it_is(steady: Photographer) -> None:
    signal = np.zeros((112, 187))
    signal[30:50, 60:90] = 1.0
    clean = taken(steady.photograph(np.zeros_like(signal), time=0.0))
    picture = taken(steady.photograph(signal, time=0.0))
    changed = (clean - picture).sum(axis=2) > 30
    rows, columns = np.nonzero(changed & sand_pixels(steady))
    x, z = steady.camera.to_metres(columns.astype(float), rows.astype(float))
    assert x.mean() == pytest.approx(75 * 0.934 / 187, abs=0.002)
    assert z.mean() == pytest.approx(40 * 0.562 / 112, abs=0.002)
    assert np.ptp(x) == pytest.approx(30 * 0.934 / 187, abs=0.006)


def test_same_seed_same_photograph_another_seed_other_grains(steady: Photographer) -> None:
    signal = np.zeros((4, 4))
    assert steady.photograph(signal, time=30.0) == photographer().photograph(signal, time=30.0)
    other = taken(photographer(seed=10).photograph(signal, time=30.0))
    same = taken(steady.photograph(signal, time=30.0))
    sand = sand_pixels(steady)
    correlation = np.corrcoef(other[sand].mean(axis=1), same[sand].mean(axis=1))[0, 1]
    assert abs(correlation) < 0.2


def test_photographs_may_be_taken_in_any_order() -> None:
    camera = photographer(Conditions(), width=400)
    signal = np.zeros((4, 4))
    late = camera.photograph(signal, time=600.0)
    camera.photograph(signal, time=30.0)
    assert camera.photograph(signal, time=600.0) == late
    assert camera.photograph(signal, time=630.0) != late


def test_lamps_drift_over_the_whole_photograph_and_the_chart_with_it() -> None:
    drifting = Conditions(light_drift=0.1, light_gradient=0.0, noise=0.0, shake_px=0.0)
    camera = photographer(drifting, width=400)
    levels = [
        taken(camera.photograph(np.zeros((4, 4)), time=t))[20:60, 50:90].mean()
        for t in range(0, 4200, 300)
    ]
    assert 0.03 < np.ptp(levels) / np.mean(levels) < 0.25


def test_displaced_camera_shifts_states_but_not_the_baseline() -> None:
    displaced = photographer(
        Conditions(0.0, 0.0, noise=0.0, shake_px=0.0, shift_px=(15.0, -8.0), quality=98), width=800
    )
    baseline = taken(displaced.baseline())
    state = taken(displaced.photograph(np.zeros((4, 4)), time=30.0))
    assert np.abs(taken(photographer().baseline()) - baseline).max() == 0.0
    grey = [
        cv2.cvtColor(p.astype(np.uint8), cv2.COLOR_BGR2GRAY).astype(float)
        for p in (baseline, state)
    ]
    shift, _ = cv2.phaseCorrelate(grey[0], grey[1])
    assert shift == pytest.approx((15.0, -8.0), abs=0.2)


def test_sensor_noise_has_the_given_strength() -> None:
    noisy = photographer(Conditions(0.0, 0.0, noise=2.0, shake_px=0.0, quality=100), width=400)
    one, two = (taken(noisy.photograph(np.zeros((4, 4)), time=t)) for t in (0.0, 30.0))
    luma = np.array([0.114, 0.587, 0.299])  # JPEG keeps luma at full resolution
    spread = ((one - two) @ luma)[100:200, 100:300].std() / np.sqrt(2)
    assert spread == pytest.approx(2.0 * np.linalg.norm(luma), rel=0.1)


def test_file_holds_the_time_of_exposure(steady: Photographer) -> None:
    with Image.open(io.BytesIO(steady.photograph(np.zeros((2, 2)), time=90.25))) as file:
        details = file.getexif().get_ifd(0x8769)
    stamp = datetime.strptime(details[0x9003], '%Y:%m:%d %H:%M:%S').replace(tzinfo=UTC)
    assert (stamp - steady.start).total_seconds() == 90.0
    assert details[0x9291] == '250'


def test_layered_rig_shows_its_sands() -> None:
    from porotwin_core.rig import rig_from_maps

    layers = np.repeat([[1e-9], [1e-11], [1e-9]], 20, axis=0) * np.ones((1, 40))
    plain = make_rig(control=None)
    fields = plain.model_dump(exclude={'depth_m', 'porosity', 'permeability_m2'})
    rig = rig_from_maps(fields, {'depth_m': 0.01, 'porosity': 0.375, 'permeability_m2': layers})
    camera = camera_before(rig, 400, 250)
    picture = taken(Photographer(rig, camera=camera, conditions=STEADY, seed=3).baseline())
    shades = []
    for height in (0.1, 0.281, 0.45):
        column, row = camera.to_pixels(np.array(0.3), np.array(height))
        r, c = round(float(row)), round(float(column))
        shades.append(picture[r - 8 : r + 8, c - 20 : c + 20].mean())
    assert shades[1] > 1.2 * max(shades[0], shades[2])


def test_signal_with_holes_is_refused(steady: Photographer) -> None:
    with pytest.raises(InputError, match='NaN'):
        steady.photograph(np.full((4, 4), np.nan), time=0.0)
