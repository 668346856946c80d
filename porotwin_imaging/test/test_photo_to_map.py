"""The whole chain on photographs of the small laboratory."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from porotwin_core.errors import InputError
from porotwin_core.grid import conservative_resample
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_imaging.calibrate import calibrate
from porotwin_imaging.calibration import Calibration, Response, load_calibration
from porotwin_imaging.chain import Imaging
from porotwin_imaging.tracer_signal import Signal

SHAPE = (450, 810)
"""Cells of the true maps: pixels of the photographs."""
CALIBRATION = Calibration(
    Signal('difference', (1.0, 0.0, 0.0)), Response((0.0, 0.65), (0.0, 1.0)), scale_error=0.01
)
NOTHING = np.zeros((2, 2))


@pytest.fixture(scope='module')
def imaging(laboratory) -> Imaging:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(90, 50), calibration=CALIBRATION)
    chain.set_baselines([laboratory.photograph(NOTHING, seed=1)])
    return chain


def error(values: np.ndarray, truth: np.ndarray) -> float:
    truth = conservative_resample(truth, values.shape)
    seen = np.isfinite(values)
    return float(np.linalg.norm((values - truth)[seen]) / np.linalg.norm(truth[seen]))


@pytest.mark.parametrize(
    'conditions',
    [{}, {'gain': 1.1, 'slope': 0.05}, {'gain': 0.9, 'shift': (15.0, -9.0)}, {'shift': (3.4, 2.2)}],
    ids=['still', 'brighter', 'darker and nudged', 'half a pixel'],
)
def test_tracer_is_read_whatever_light_and_camera_do(
    imaging, laboratory, make_plume, conditions
) -> None:
    truth = make_plume(SHAPE, 0.4, 0.25, 0.12)
    found = imaging.concentration(laboratory.photograph(truth, **conditions))
    assert error(found.values, truth) < 0.03
    assert np.nanmean(found.values) == pytest.approx(truth.mean(), rel=0.02)
    shift = np.hypot(*conditions.get('shift', (0, 0)))
    assert any('camera has moved' in line for line in found.status) == (shift > 2)


def test_row_zero_is_the_bottom(imaging, laboratory, make_plume) -> None:
    found = imaging.concentration(laboratory.photograph(make_plume(SHAPE, 0.2, 0.1, 0.06)))
    assert found.values[:20].sum() > 10 * found.values[30:].sum()
    assert found.values[:, :40].sum() > 10 * found.values[:, 50:].sum()


def test_the_stated_noise_is_that_of_the_map(imaging, laboratory, make_plume) -> None:
    truth = make_plume(SHAPE, 0.4, 0.25, 0.12)
    found = imaging.concentration(laboratory.photograph(truth, noise=3.0, seed=4))
    truth = conservative_resample(truth, found.values.shape)
    within = np.abs(found.values - truth) < 2 * found.noise
    assert within.mean() > 0.85
    assert 1e-4 < found.typical_noise < 0.02


def test_glare_is_not_seen_and_what_hides_the_sand_is_nan(imaging, laboratory) -> None:
    light = laboratory.scene(NOTHING)
    light[320:360, 300:360] = 1.0
    data = encode(light)
    found = imaging.concentration(data)
    x, z = int((330 - 40) / 9), int((150 + 450 - 340) / 9)
    assert np.isnan(found.values[z, x])
    assert np.isfinite(found.values).mean() > 0.97


def encode(light: np.ndarray) -> bytes:
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    pixels = np.clip(255 * curve, 0, 255).astype(np.uint8)[..., ::-1]
    return cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()


@pytest.mark.parametrize('grid', [(90, 50), (400, 222)])
def test_a_hand_before_the_camera_is_no_tracer(laboratory, make_plume, grid) -> None:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(*grid), calibration=CALIBRATION)
    chain.set_baselines([laboratory.photograph(NOTHING, seed=1)])
    truth = make_plume(SHAPE, 0.6, 0.25, 0.1)
    light = laboratory.scene(truth)
    light[300:640, 150:300] = [0.1, 0.06, 0.04]
    found = chain.concentration(encode(light))
    hand = (slice(0, int(0.55 * grid[1])), slice(int(0.15 * grid[0]), int(0.27 * grid[0])))
    assert np.isnan(found.values[hand]).all()
    assert error(found.values, truth) < 0.05
    assert found.suspicious
    assert any('is covered or' in line for line in found.status)


def test_a_chart_dark_in_one_channel_leaves_the_light_to_the_sand(laboratory, make_plume) -> None:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(90, 50), calibration=CALIBRATION)
    truth = make_plume(SHAPE, 0.4, 0.25, 0.12)
    pictures = [laboratory.scene(c) for c in (NOTHING, truth)]
    for light in pictures:
        light[:130, :, 2] *= 0.05  # blue of the chart, above the sand
    chain.set_baselines([encode(pictures[0])])
    found = chain.concentration(encode(pictures[1]))
    assert any('light is judged by the sand alone' in line for line in found.status)
    assert error(found.values, truth) < 0.05


def test_an_orientation_that_is_not_applied_is_told_with_the_baseline(laboratory) -> None:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(90, 50), calibration=CALIBRATION)
    file, tags = io.BytesIO(), Image.Exif()
    tags[0x0112] = 3
    upright = laboratory.photograph(NOTHING, seed=1)
    Image.open(io.BytesIO(upright)).save(file, 'JPEG', quality=95, exif=tags)
    remarks = chain.set_baselines([file.getvalue()])
    assert any('EXIF orientation 3 is not applied' in line for line in remarks)
    assert not any('EXIF' in line for line in chain.set_baselines([upright]))


def test_a_file_damaged_in_its_middle_is_refused_or_left_out(imaging, laboratory) -> None:
    data = bytearray(laboratory.photograph(NOTHING, seed=3))
    middle = len(data) // 2
    data[middle : middle + 3000] = bytes(3000)
    with pytest.raises(InputError, match='does not show the grains'):
        imaging.concentration(bytes(data))
    data = bytearray(laboratory.photograph(NOTHING, seed=3))
    late = int(0.85 * len(data))
    data[late : late + 3000] = bytes(3000)
    found = imaging.concentration(bytes(data))
    assert found.suspicious
    assert np.nanmax(found.values) < 0.05


def test_the_same_photograph_gives_the_same_map(imaging, laboratory, make_plume) -> None:
    data = laboratory.photograph(make_plume(SHAPE, 0.5, 0.2, 0.1))
    first, second = imaging.concentration(data), imaging.concentration(data)
    np.testing.assert_array_equal(first.values, second.values)


def test_without_calibration_the_status_says_so(laboratory) -> None:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(90, 50))
    chain.set_baselines([laboratory.photograph(NOTHING)])
    found = chain.concentration(laboratory.photograph(NOTHING, seed=2))
    assert not found.calibrated
    assert found.status == ['uncalibrated: default scaling']


def test_several_baselines_tell_their_fluctuation(laboratory, make_plume) -> None:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(90, 50), calibration=CALIBRATION)
    baselines = [
        laboratory.photograph(NOTHING, gain=1 + 0.02 * n, shift=(0.7 * n, 0), seed=n)
        for n in range(3)
    ]
    remarks = chain.set_baselines(baselines)
    assert not any('one baseline' in remark for remark in remarks)
    truth = make_plume(SHAPE, 0.4, 0.25, 0.12)
    assert error(chain.concentration(laboratory.photograph(truth)).values, truth) < 0.03


@pytest.mark.parametrize('grid', [(30, 17), (90, 50), (300, 167), (890, 480)])
def test_any_grid_holds_the_same_mass(laboratory, make_plume, grid) -> None:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(*grid), calibration=CALIBRATION)
    chain.set_baselines([laboratory.photograph(NOTHING, seed=1)])
    truth = make_plume(SHAPE, 0.4, 0.25, 0.12)
    found = chain.concentration(laboratory.photograph(truth))
    assert found.values.shape == (grid[1], grid[0])
    assert np.nanmean(found.values) == pytest.approx(truth.mean(), rel=0.03)


def test_photographs_that_cannot_be_used_are_refused_and_the_next_is_read(
    imaging, laboratory, new_laboratory, make_plume
) -> None:
    truth = make_plume(SHAPE, 0.4, 0.25, 0.12)
    good = laboratory.photograph(truth)
    other = new_laboratory(seed=77).photograph(NOTHING)
    larger = cv2.imencode('.jpg', np.full((700, 890, 3), 90, np.uint8))[1].tobytes()
    for data, complaint in (
        (good[: len(good) // 2], 'truncated'),
        (laboratory.photograph(NOTHING, gain=0.0005, noise=0.0), 'black'),
        (laboratory.photograph(NOTHING, gain=60.0), 'over-exposed'),
        (larger, 'px, the baseline'),
        (other, 'does not match the baseline'),
    ):
        with pytest.raises(InputError, match=complaint):
            imaging.concentration(data)
    assert error(imaging.concentration(good).values, truth) < 0.03


def test_a_photograph_needs_a_baseline_and_a_baseline_a_photograph(laboratory) -> None:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(90, 50))
    with pytest.raises(InputError, match='no baseline yet'):
        chain.concentration(laboratory.photograph(NOTHING))
    with pytest.raises(InputError, match='no baseline photograph'):
        chain.set_baselines([])
    small = cv2.imencode('.jpg', np.full((100, 200, 3), 90, np.uint8))[1].tobytes()
    with pytest.raises(InputError, match='corners_px reach to'):
        chain.set_baselines([small])


def test_a_refused_baseline_leaves_the_earlier_one_in_use(laboratory, make_plume) -> None:
    chain = Imaging(laboratory.rig, laboratory.rig.grid(90, 50), calibration=CALIBRATION)
    chain.set_baselines([laboratory.photograph(NOTHING, seed=1)])
    data = laboratory.photograph(make_plume(SHAPE, 0.4, 0.25, 0.12))
    before = chain.concentration(data)
    grey = cv2.imencode('.jpg', np.full((2 * 640, 2 * 890, 3), 90, np.uint8))[1].tobytes()
    black = laboratory.photograph(NOTHING, gain=0.0005, noise=0.0)
    moved = laboratory.photograph(NOTHING, shift=(9.0, 5.0), seed=2)
    for refused in ([grey], [black], [moved, black], [moved, grey]):
        with pytest.raises(InputError):
            chain.set_baselines(refused)
        np.testing.assert_array_equal(chain.concentration(data).values, before.values)


def test_a_calibration_balances_mass_and_is_read_back(new_laboratory, make_plume, tmp_path) -> None:
    laboratory = new_laboratory(finer_below=0.22, uptake=(1.0, 0.75))
    rig = laboratory.rig
    pore_depth = 0.4 * 0.01 * rig.width_m * rig.height_m
    truths = [make_plume(SHAPE, 0.4, 0.24, radius) for radius in (0.05, 0.08, 0.11, 0.14)]
    volumes = [0.0, *(pore_depth * float(truth.mean()) for truth in truths)]
    times = [60.0 * n for n in range(5)]
    schedule = Schedule(
        tuple(
            ScheduleRow(time, 'injector', WellRate((after - before) / 60.0, 1.0))
            for time, before, after in zip(times, volumes, volumes[1:], strict=False)
        )
    )
    states = [
        (time, laboratory.photograph(truth, gain=1 + 0.03 * n, seed=n))
        for n, (time, truth) in enumerate(zip(times[1:], truths, strict=True))
    ]
    states.insert(2, (130.0, b'broken'))
    baseline = laboratory.photograph(NOTHING, seed=50)
    result = calibrate(rig, [baseline], states, schedule=schedule, output=tmp_path, source='test')
    assert any('130 s left out' in line for line in result.lines)
    assert len(result.calibration.factors) == 2
    assert sorted(path.name for path in tmp_path.glob('*.png'))[0] == '1_geometry.png'
    calibration = load_calibration(tmp_path / 'calibration.yaml')
    chain = Imaging(rig, rig.grid(90, 50), calibration=calibration)
    chain.set_baselines([baseline])
    truth = make_plume(SHAPE, 0.45, 0.22, 0.1)
    found = chain.concentration(laboratory.photograph(truth, gain=0.95, seed=60))
    assert found.calibrated
    assert error(found.values, truth) < 0.05
    assert np.nanmean(found.values) == pytest.approx(truth.mean(), rel=0.02)


def test_photographs_without_tracer_calibrate_nothing(laboratory) -> None:
    states = [(60.0 * n, laboratory.photograph(NOTHING, seed=n)) for n in range(3)]
    with pytest.raises(InputError, match='no photograph shows tracer'):
        calibrate(laboratory.rig, [laboratory.photograph(NOTHING, seed=9)], states)
