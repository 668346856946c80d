"""Blinded cases seen by a camera."""

from dataclasses import replace

import numpy as np
import pytest
from photo_examples import small_rig, textured_baseline

from lab.blind.blind_cases import SMALL, draw_case
from lab.blind.blind_photographs import (
    INJECTION,
    INJECTIONS_M,
    RECORDING,
    ComposedRoom,
    RenderedRoom,
    calibration_schedule,
    photograph_case,
    with_read_corners,
)
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rig import EffectDescription
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData


def baseline_folder(folder):
    """Write and return an experiment folder with a baseline photograph of a small rig."""
    cv2 = pytest.importorskip('cv2')
    pixels = cv2.imencode('.jpg', textured_baseline())[1].tobytes()
    photo = Photo(0.0, 'baseline', 'photos/baseline.jpg', lambda: pixels)
    write_folder(folder, RecordedData(small_rig(), photos=(photo,)))
    return folder


def test_a_calibration_injects_a_plume_of_the_stated_size():
    case = draw_case(1, 1)
    schedule, end = calibration_schedule(case)
    injected = schedule.injected_stock(0.0, end)
    pores = SMALL.pore_volume / (SMALL.width_m * SMALL.height_m)
    assert injected == pytest.approx(np.pi * INJECTIONS_M**2 * pores)
    assert schedule.wells == ('injector',)
    assert schedule.at(0.0)['injector'].rate >= from_ml_h(100.0)


def test_corners_are_read_with_a_small_error():
    rig = small_rig()
    read = with_read_corners(rig, 480, seed=3)
    apart = np.array(read.camera.corners_px) - np.array(rig.camera.corners_px)
    assert 0.0 < np.abs(apart).max() < 1.0
    assert with_read_corners(rig, 480, seed=3) == read
    with pytest.raises(InputError, match='no camera'):
        with_read_corners(SMALL, 480, seed=3)


def test_another_experiment_has_another_light_and_another_shake():
    room = RenderedRoom(draw_case(0, 1), width_px=160)
    signal = np.full((56, 93), 0.5)
    one, other = (room.camera(number, 600.0) for number in (0, 1))
    assert one.photograph(signal, 60.0) == one.photograph(signal, 60.0)
    assert one.photograph(signal, 60.0) != other.photograph(signal, 60.0)
    assert one.baseline() != other.baseline()


def test_tracer_is_composed_on_a_real_baseline(tmp_path):
    folder = baseline_folder(tmp_path / 'real')
    case = draw_case(0, 1, small_rig())
    assert case.rig.wells.keys() == {'left', 'right'}
    assert {row.well for row in case.schedule.rows} == {'left', 'right'}
    room = ComposedRoom(case, folder)
    camera = room.camera(0, 600.0)
    assert camera.photograph(np.full((27, 44), 1.0), 60.0) != camera.baseline()
    assert room.told.camera.corners_px != small_rig().camera.corners_px


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_photographs_of_a_flawed_rig_become_maps_with_deviations(tmp_path):
    """The maps show the effect; the folder of the recording does not tell it."""
    wide = EffectDescription(
        name='dispersion',
        parameters={
            'longitudinal_dispersivity': 2.7e-3,
            'transverse_dispersivity': 3e-4,
            'diffusion': 1e-9,
        },
    )
    case = replace(
        draw_case(0, 103, coarse=True),
        effects=(wide,),
        duration=1200.0,
        photo_interval=300.0,
        element_m=0.0075,
    )
    folder, clean = tmp_path / 'case', tmp_path / 'clean.nc'
    photograph_case(case, folder, clean=clean)
    recording = open_recording(folder / RECORDING)
    assert recording.maps.origin.calibrated
    assert len(recording.times) == 4
    deviation, systematic = recording.maps.deviation[-1], recording.maps.systematic[-1]
    assert np.nanmin(deviation - systematic) >= 0.0
    volume = case.rig.cell_pore_volume(recording.grid)
    seen = float(np.nansum(recording.concentration[-1] * volume))
    injected = case.schedule.injected_stock(0.0, float(recording.times[-1]))
    assert seen / injected == pytest.approx(1.0, rel=0.06)
    words = (folder / RECORDING / 'rig.yaml').read_text()
    assert 'dispersi' not in words
    assert not list((folder / RECORDING).glob('*truth*'))
    made = (folder / INJECTION / 'imaging.csv').stat().st_mtime_ns
    photograph_case(case, folder, clean=clean)
    assert (folder / INJECTION / 'imaging.csv').stat().st_mtime_ns == made
