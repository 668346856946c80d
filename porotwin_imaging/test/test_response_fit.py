"""The response from masses and dilutions."""

import numpy as np
import pytest

from porotwin_imaging.calibrating.response_fit import Dilution, fit_response

PORE_VOLUME_M3 = 4e-8


def plumes() -> list[np.ndarray]:
    z, x = np.mgrid[-1:1:80j, -1:1:120j]
    shapes = ((0.2, 0.05), (0.3, 0.1), (0.4, 0.2), (0.5, 0.1), (0.6, 0.3), (0.7, 0.2))
    return [0.5 * (1 - np.tanh((np.hypot(x, z) - radius) / width)) for radius, width in shapes]


def bent(concentration: np.ndarray, curvature: float) -> np.ndarray:
    return np.expm1(-curvature * concentration) / np.expm1(-curvature)


@pytest.mark.parametrize('curvature', [-0.5, 0.5])
@pytest.mark.parametrize('pores', [1.0, 0.9])
def test_the_mass_shows_the_bend_even_with_wrong_pores(curvature, pores) -> None:
    truth = plumes()
    volume = np.full(truth[0].shape, PORE_VOLUME_M3)
    injected = [float((c * volume).sum()) / pores for c in truth]
    found = fit_response([bent(c, curvature) for c in truth], volume, injected)
    assert found.bend == pytest.approx(-np.sign(curvature) * 0.06, abs=0.03)


@pytest.mark.parametrize('offset', [-0.08, 0.08])
def test_tracer_that_a_late_clock_shows_does_not_bend_the_response(offset) -> None:
    truth = plumes()
    volume = np.full(truth[0].shape, PORE_VOLUME_M3)
    imaged = [float((c * volume).sum()) for c in truth]
    injected = [mass - offset * imaged[-1] for mass in imaged]
    found = fit_response([bent(c, 0.4) for c in truth], volume, injected)
    assert found.bend == pytest.approx(-0.05, abs=0.07)


def test_photographs_in_quick_succession_make_the_bend_no_surer() -> None:
    truth = plumes()
    volume = np.full(truth[0].shape, PORE_VOLUME_M3)
    injected = [float((c * volume).sum()) for c in truth]
    twice, often = (
        fit_response(times * [bent(c, 0.4) for c in truth], volume, times * injected)
        for times in (2, 20)
    )
    assert often.deviation == pytest.approx(twice.deviation, rel=0.02)


def test_without_evidence_the_prior_and_its_deviation_remain() -> None:
    found = fit_response([], np.ones((2, 2)), [])
    assert found.bend == pytest.approx(-0.02, abs=0.003)
    assert found.deviation == pytest.approx(0.067, abs=0.006)


def test_dilutions_determine_the_curve_and_its_deviation() -> None:
    known = np.array([0.25, 0.5, 0.75, 1.0])
    dilutions = [Dilution(float(s), float(c)) for s, c in zip(bent(known, 1.2), known, strict=True)]
    found = fit_response([], np.ones((2, 2)), [], dilutions)
    assert found.deviation < 0.01
    signal = bent(np.linspace(0, 1, 21), 1.2)
    np.testing.assert_allclose(found.concentration_of(signal), np.linspace(0, 1, 21), atol=0.01)
    curve = found.curve(1.9)
    np.testing.assert_allclose(
        curve.concentration_of(1.9 * signal), np.linspace(0, 1, 21), atol=0.012
    )


def test_the_deviation_vanishes_at_water_and_stock() -> None:
    curve = fit_response([], np.ones((2, 2)), []).curve(1.0)
    assert curve.deviation_of(np.array([0.0, 1.0])) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert curve.deviation_of(np.array([0.5])) == pytest.approx([0.067], abs=0.01)
