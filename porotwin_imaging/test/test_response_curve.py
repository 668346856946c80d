"""The response."""

import numpy as np
import pytest

from porotwin_imaging.tracer.response_curve import concentration_of

SIGNAL = np.linspace(-0.1, 1.2, 131)


@pytest.mark.parametrize('bend', [-0.25, -0.04, 0.0, 0.1, 0.25])
def test_a_curve_rises_from_water_to_stock_with_its_bend(bend) -> None:
    found = concentration_of(SIGNAL, bend)
    assert (np.diff(found) > 0).all()
    ends = concentration_of(np.array([0.0, 0.5, 1.0]), bend)
    np.testing.assert_allclose(ends, [0.0, 0.5 + bend, 1.0], atol=1e-6)


def test_it_inverts_a_saturating_dye() -> None:
    concentration = np.linspace(0, 1, 11)
    signal = np.expm1(-0.3 * concentration) / np.expm1(-0.3)
    bend = -np.log1p(0.5 * np.expm1(-0.3)) / 0.3 - 0.5
    np.testing.assert_allclose(concentration_of(signal, bend), concentration)
