"""The calibration from photographs of an injection."""

import numpy as np
import pytest

from porotwin_core.errors import InputError
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_imaging.baseline import make_baseline
from porotwin_imaging.calibration import load_calibration
from porotwin_imaging.calibration_fit import fit_calibration
from porotwin_imaging.calibration_pictures import write_fit
from porotwin_imaging.photo_to_map import concentration_map


def test_a_calibration_balances_mass_and_is_read_back(
    new_laboratory, make_plume, true_shape, no_tracer, relative_error, tmp_path
) -> None:
    laboratory = new_laboratory(finer_below=0.22, uptake=(1.0, 0.75))
    rig = laboratory.rig
    pore_volume = 0.4 * 0.01 * rig.width_m * rig.height_m
    truths = [make_plume(true_shape, 0.4, 0.24, radius) for radius in (0.05, 0.08, 0.11, 0.14)]
    volumes = [0.0, *(pore_volume * float(truth.mean()) for truth in truths)]
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
    empty = laboratory.photograph(no_tracer, seed=50)
    fit = fit_calibration(rig, [empty], states, schedule=schedule, source='test')
    assert any('130 s left out' in line for line in fit.lines)
    assert len(fit.calibration.factors) == 2
    assert write_fit(fit, tmp_path)[0].name == '1_geometry.png'
    assert sorted(path.name for path in tmp_path.glob('*.png'))[0] == '1_geometry.png'
    calibration = load_calibration(tmp_path / 'calibration.yaml')
    baseline = make_baseline(rig, rig.grid(90, 50), [empty], calibration=calibration)
    truth = make_plume(true_shape, 0.45, 0.22, 0.1)
    found = concentration_map(laboratory.photograph(truth, gain=0.95, seed=60), baseline)
    assert found.calibrated
    assert relative_error(found.values, truth) < 0.05
    assert np.nanmean(found.values) == pytest.approx(truth.mean(), rel=0.02)


def test_photographs_without_tracer_are_refused(laboratory, no_tracer) -> None:
    states = [(60.0 * n, laboratory.photograph(no_tracer, seed=n)) for n in range(3)]
    with pytest.raises(InputError, match='no photograph shows tracer'):
        fit_calibration(laboratory.rig, [laboratory.photograph(no_tracer, seed=9)], states)
