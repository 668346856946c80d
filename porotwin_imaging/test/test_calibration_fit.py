"""The calibration from photographs of an injection."""

from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.calibrating.calibration_fit import (
    CalibrationFit,
    DilutionPhoto,
    InjectionSource,
    fit_calibration,
)
from porotwin_imaging.calibrating.calibration_pictures import write_fit
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.tracer.calibration import load_calibration

RADII = (0.05, 0.08, 0.11, 0.14)
INTERVAL_S = 60.0


@dataclass(frozen=True)
class Injection:
    """Photographs of a known injection in a rig with two sands."""

    rig: Rig
    empty: bytes
    states: list[tuple[float, bytes]]
    volumes: list[float]

    def schedule(self, factor: float = 1.0) -> Schedule:
        """Return a pump log whose rates are `factor` times the true ones."""
        return Schedule(
            tuple(
                ScheduleRow(
                    n * INTERVAL_S,
                    'injector',
                    WellRate(factor * (after - before) / INTERVAL_S, 1.0),
                )
                for n, (before, after) in enumerate(
                    zip(self.volumes, self.volumes[1:], strict=False)
                )
            )
        )


@pytest.fixture(scope='module')
def laboratory_of_two_sands(new_laboratory):
    return new_laboratory(finer_below=0.22, uptake=(1.0, 0.75))


@pytest.fixture(scope='module')
def injection(laboratory_of_two_sands, make_plume, true_shape, no_tracer) -> Injection:
    laboratory = laboratory_of_two_sands
    rig = laboratory.rig
    pore_volume = 0.4 * 0.01 * rig.width_m * rig.height_m
    truths = [make_plume(true_shape, 0.4, 0.24, radius) for radius in RADII]
    states = [
        (INTERVAL_S * (n + 1), laboratory.photograph(truth, gain=1 + 0.03 * n, seed=n))
        for n, truth in enumerate(truths)
    ]
    volumes = [0.0, *(pore_volume * float(truth.mean()) for truth in truths)]
    return Injection(rig, laboratory.photograph(no_tracer, seed=50), states, volumes)


@pytest.fixture(scope='module')
def fit(injection) -> CalibrationFit:
    """The calibration of the injection; a broken photograph is among the others."""
    states = [*injection.states[2:], (130.0, b'broken'), *injection.states[:2]]
    return fit_calibration(
        injection.rig,
        [injection.empty],
        iter(states),
        schedule=injection.schedule(),
        source=InjectionSource('test'),
    )


def test_a_calibration_reads_other_photographs_and_is_read_back(
    laboratory_of_two_sands, injection, fit, make_plume, true_shape, relative_error, tmp_path
) -> None:
    rig, empty = injection.rig, injection.empty
    assert any('130 s left out' in line for line in fit.lines)
    assert len(fit.calibration.factors) == 2
    assert fit.evidence.anchor == 'core'
    assert fit.evidence.mass_factor == pytest.approx(1.0, abs=0.02)
    assert not fit.evidence.disagreeing
    assert write_fit(fit, tmp_path)[0].name == '1_geometry.png'
    assert sorted(path.name for path in tmp_path.glob('*.png'))[0] == '1_geometry.png'
    calibration = load_calibration(tmp_path / 'calibration.yaml')
    assert calibration.made['anchor'] == 'core'
    size = {'width_m': rig.width_m, 'height_m': rig.height_m}
    assert calibration.made['rig'] == {'name': rig.name, **size}
    baseline = make_baseline(rig, rig.grid(90, 50), [empty], calibration=calibration)
    truth = make_plume(true_shape, 0.45, 0.22, 0.1)
    photograph = laboratory_of_two_sands.photograph(truth, gain=0.95, seed=60)
    found = concentration_map(photograph, baseline)
    assert found.calibrated
    assert relative_error(found.values, truth) < 0.03
    assert np.nanmean(found.values) == pytest.approx(truth.mean(), rel=0.02)


def test_a_wrong_pump_log_changes_the_mass_factor_and_not_the_maps(injection) -> None:
    fit = fit_calibration(
        injection.rig, [injection.empty], injection.states, schedule=injection.schedule(3.0)
    )
    assert fit.evidence.mass_factor == pytest.approx(1 / 3, rel=0.05)
    assert fit.calibration.response.concentration_of(np.array([fit.stock_signal])) == pytest.approx(
        [1.0], abs=0.01
    )


def test_the_storage_of_the_described_effects_counts(injection) -> None:
    rig = injection.rig
    fit = fit_calibration(
        rig,
        [injection.empty],
        injection.states,
        schedule=injection.schedule(3.0),
        storage=lambda grid: 3.0 * rig.cell_pore_volume(grid),
    )
    assert fit.evidence.mass_factor == pytest.approx(1.0, rel=0.05)


def test_remaining_light_away_from_the_plume_is_no_tracer(
    laboratory_of_two_sands, injection, fit, make_plume, true_shape
) -> None:
    """Lamps drift, so that such light comes and goes: in one of four photographs here."""
    dimmer = make_plume(true_shape, 0.4, 0.24, RADII[1]) + 0.06 * make_plume(
        true_shape, 0.7, 0.24, 0.1
    )
    states = [*injection.states]
    states[1] = (states[1][0], laboratory_of_two_sands.photograph(dimmer, gain=1.03, seed=1))
    dimmed = fit_calibration(
        injection.rig, [injection.empty], states, schedule=injection.schedule()
    )
    assert dimmed.response.bend == pytest.approx(fit.response.bend, abs=0.01)
    assert dimmed.evidence.mass_factor == pytest.approx(fit.evidence.mass_factor, abs=0.01)


def test_the_tracer_behind_a_thing_before_the_plume_counts(injection, fit) -> None:
    """The pump log counts it. A label hides a part of every plume here."""
    left, _, right, _ = injection.rig.camera.corners_px
    place = [
        round(a + share * (b - a)) for share, a, b in zip((0.37, 0.5), left, right, strict=True)
    ]
    states = [(time, _with_label(photograph, *place)) for time, photograph in injection.states]
    hidden = fit_calibration(
        injection.rig, [injection.empty], states, schedule=injection.schedule()
    )
    assert hidden.evidence.mass_factor == pytest.approx(fit.evidence.mass_factor, abs=0.01)


def _with_label(photograph: bytes, column: int, row: int) -> bytes:
    """Return `photograph` with a magenta label around a pixel."""
    pixels = cv2.imdecode(np.frombuffer(photograph, np.uint8), cv2.IMREAD_COLOR)
    pixels[row - 12 : row + 12, column - 12 : column + 12] = (200, 40, 230)
    return cv2.imencode('.png', pixels)[1].tobytes()


@pytest.mark.usefixtures('undrawn')
def test_dilutions_are_the_anchor_where_there_are_some(
    laboratory_of_two_sands, injection, make_plume, true_shape, tmp_path
) -> None:
    plume = make_plume(true_shape, 0.4, 0.3, 0.14)
    dilutions = [
        DilutionPhoto(
            600.0, partial(laboratory_of_two_sands.photograph, share * plume, seed=70), share
        )
        for share in (0.5, 1.0)
    ]
    fit = fit_calibration(injection.rig, [injection.empty], injection.states, dilutions=dilutions)
    assert fit.evidence.anchor == 'dilutions'
    assert fit.evidence.dilution_misfit < 0.02
    assert fit.evidence.bend_deviation < 0.02
    assert np.isnan(fit.evidence.mass_factor)
    write_fit(fit, tmp_path)  # the pictures need no pump log


def test_a_dilution_that_cannot_be_used_is_named(injection) -> None:
    broken = DilutionPhoto(600.0, lambda: b'no photograph', 0.5)
    with pytest.raises(InputError, match=r'dilution 0\.5 at 600 s: photograph'):
        fit_calibration(injection.rig, [injection.empty], injection.states, dilutions=[broken])


def test_photographs_without_tracer_are_refused(laboratory, no_tracer, empty_photograph) -> None:
    states = [(60.0 * n, laboratory.photograph(no_tracer, seed=n)) for n in (2, 3)]
    with pytest.raises(InputError, match='no photograph shows tracer'):
        fit_calibration(laboratory.rig, [empty_photograph], states)
