"""Drawn cases of composed photographs, and the folders that they write."""

from pathlib import Path

import cv2
import netCDF4
import numpy as np
import pytest
import yaml
from photo_examples import PICTURE, small_rig, textured_baseline

from lab.photographs import photo_cases
from lab.photographs.photo_cases import baseline_of, draw_case, write_case
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_recording.experiment.experiment_folder import folder_data


@pytest.fixture(autouse=True)
def coarse(monkeypatch) -> None:
    monkeypatch.setattr(photo_cases, 'TRUTH_GRID', (44, 27))
    monkeypatch.setattr(photo_cases, 'RECORDED', 3)


@pytest.fixture
def folder(tmp_path) -> Path:
    return write_case(draw_case(small_rig(), 0, 1, 'log x3'), textured_baseline(), tmp_path)


def test_the_same_seed_draws_the_same_case_and_another_seed_another() -> None:
    one, same, other = (draw_case(small_rig(), 3, seed) for seed in (1, 1, 2))
    assert one.calibration == same.calibration
    np.testing.assert_array_equal(one.dye.absorption, same.dye.absorption)
    assert one.calibration != other.calibration


def test_a_case_is_two_experiment_folders_and_its_truth(folder) -> None:
    recording, calibration = folder_data(folder), folder_data(folder.with_name('c000_cal'))
    assert [photo.role for photo in recording.photos] == ['baseline', *['state'] * 3]
    assert len(calibration.photos) == 1 + photo_cases.PHOTOGRAPHS
    pixels = cv2.imdecode(np.frombuffer(recording.photos[0].read(), np.uint8), cv2.IMREAD_COLOR)
    assert pixels.shape[:2] == PICTURE
    with netCDF4.Dataset(folder / 'truth.nc') as truth:
        assert truth['concentration'].shape == (4, 27, 44)
        assert truth['concentration'][0].max() == 0
        assert truth['concentration'][1:].max() > 0.9
    told = yaml.safe_load((folder / 'truth.yaml').read_text())
    assert (told['flaw'], told['expected']) == ('log x3', 'refuse')


def test_only_the_pump_log_of_the_calibration_is_wrong(folder) -> None:
    case = draw_case(small_rig(), 0, 1, 'log x3')
    told = folder_data(folder.with_name('c000_cal')).commanded
    for row, true in zip(told.rows, case.calibration.schedule.rows, strict=True):
        assert to_ml_h(row.rate.rate) == pytest.approx(3 * to_ml_h(true.rate.rate), rel=1e-6)
    recorded = folder_data(folder).commanded
    assert len(recorded.rows) == len(case.recording.schedule.rows)


def test_flaws_of_photographs_are_where_they_belong() -> None:
    rig = small_rig()
    assert draw_case(rig, 1, 1, 'dyed baseline').calibration.baseline_time > 100
    assert draw_case(rig, 1, 1, 'none').calibration.baseline_time == 0
    hidden = [one is not None for one in draw_case(rig, 1, 1, 'hand').calibration.obstacles]
    assert sum(hidden) == 1
    assert not any(draw_case(rig, 1, 1, 'hand').recording.obstacles)
    assert draw_case(rig, 1, 1, 'no absorption').dye.absorption.max() == 0
    moved = draw_case(rig, 1, 1, 'moved').calibration.shots
    assert np.hypot(*moved[-1].shift) > 6
    (effect,) = draw_case(rig, 1, 1, 'retardation').effects
    assert 1.04 <= effect.parameters['retardation_factor'] <= 1.12


def test_the_baseline_comes_from_an_experiment_folder(folder, tmp_path) -> None:
    rig, pixels = baseline_of(folder)
    assert rig == small_rig()
    assert pixels.shape[:2] == PICTURE
    (folder / 'imaging.csv').write_text('time_s,path,role\n0,photos/photo_001.jpg,state\n')
    with pytest.raises(InputError, match='no baseline photograph'):
        baseline_of(folder)


def test_an_unknown_flaw_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="flaw 'x' is not known; choose none"):
        draw_case(small_rig(), 0, 1, 'x')
