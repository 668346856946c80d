"""Factors of sands from the plumes of an experiment."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_imaging.calibrating.sand_refinement import refined
from porotwin_imaging.live.imaging_session import ImagingSession
from porotwin_imaging.tracer.calibration import load_calibration, save_calibration

INTERFACE_M, HEIGHT_M = 0.22, 0.5
UPTAKE = 0.75
"""Colour of tracer in the lower sand relative to the upper one."""


@pytest.fixture
def two_sands(new_laboratory):
    return new_laboratory(finer_below=INTERFACE_M, uptake=(1.0, UPTAKE))


@pytest.fixture
def guessed(calibration):
    """Return a calibration whose factor of the lower sand is a guess."""
    sands = np.zeros((200, 360), np.uint8)
    sands[round(200 * (1 - INTERFACE_M / HEIGHT_M)) :] = 1
    return replace(calibration, sands=sands, factors=(1.0, 1.15), factor_deviations=(0.0, 0.15))


def injecting(concentration: float) -> Schedule:
    return Schedule((ScheduleRow(0.0, 'injector', WellRate(1e-7, concentration)),))


def experiment(laboratory, plume):
    return [(60.0, lambda: laboratory.photograph(plume, seed=2))]


def test_a_plume_of_stock_in_two_sands_tells_the_factor_of_the_guessed_one(
    two_sands, guessed, make_plume, true_shape, no_tracer
) -> None:
    states = experiment(two_sands, make_plume(true_shape, 0.4, 0.24, 0.14))
    empty = two_sands.photograph(no_tracer, seed=1)
    found = refined(guessed, two_sands.rig, [empty], states, injecting(1.0), source='monday')
    assert found.calibration.factors[1] == pytest.approx(1 / UPTAKE, rel=0.03)
    assert found.calibration.made['sands_from'] == ['unknown', 'core in monday']
    assert found.calibration.factor_deviations[1] < 0.03
    assert found.calibration.factors[0] == 1.0
    assert 'sand 1' in found.lines[0]


@pytest.mark.parametrize('schedule', [None, injecting(0.5)], ids=['no pump log', 'a dilution'])
def test_nothing_is_learnt_from_a_fluid_that_may_be_no_stock(
    two_sands, guessed, make_plume, true_shape, no_tracer, schedule
) -> None:
    states = experiment(two_sands, make_plume(true_shape, 0.4, 0.24, 0.14))
    empty = two_sands.photograph(no_tracer, seed=1)
    assert refined(guessed, two_sands.rig, [empty], states, schedule).calibration is guessed


def test_a_plume_that_is_paler_than_stock_is_not_taken_for_it(
    two_sands, guessed, make_plume, true_shape, no_tracer
) -> None:
    states = experiment(two_sands, 0.8 * make_plume(true_shape, 0.4, 0.24, 0.14))
    empty = two_sands.photograph(no_tracer, seed=1)
    found = refined(guessed, two_sands.rig, [empty], states, injecting(1.0))
    assert found.calibration.factors == guessed.factors


def test_the_running_twin_uses_what_was_learnt(
    two_sands, guessed, make_plume, true_shape, no_tracer, tmp_path
) -> None:
    states = experiment(two_sands, make_plume(true_shape, 0.4, 0.24, 0.14))
    empty = two_sands.photograph(no_tracer, seed=1)
    learnt = refined(guessed, two_sands.rig, [empty], states, injecting(1.0)).calibration
    save_calibration(learnt, tmp_path / 'calibration.yaml')
    lower = {}
    for name, used in (
        ('before', guessed),
        ('after', load_calibration(tmp_path / 'calibration.yaml')),
    ):
        session = ImagingSession(two_sands.rig, two_sands.rig.grid(90, 50), calibration=used)
        session.add_baseline(empty)
        values = session.add_photo(60.0, states[0][1]()).map.values
        lower[name] = float(np.median(values[14:18, 36:44]))  # stock in the lower sand
    assert lower['before'] < 0.9
    assert lower['after'] == pytest.approx(1.0, abs=0.02)
