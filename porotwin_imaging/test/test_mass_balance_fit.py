"""The mass balance of an injection."""

import numpy as np
import pytest

from porotwin_imaging.calibrating.mass_balance_fit import fit_line


def test_the_line_is_found_despite_outliers() -> None:
    volume = np.linspace(1, 10, 10) * 1e-5
    imaged = 0.9 * volume
    imaged[[2, 7]] *= [1.6, 0.3]
    line = fit_line(imaged, volume)
    assert line.factor == pytest.approx(0.9, rel=1e-3)
    assert list(np.flatnonzero(~line.agree)) == [2, 7]
    assert line.misfit < 1e-3


def test_mass_seen_before_the_injection_is_no_factor() -> None:
    volume = np.linspace(1, 10, 7) * 1e-5
    line = fit_line(volume + 2e-6, volume)
    assert line.factor == pytest.approx(1.0, abs=0.01)
    assert line.offset == pytest.approx(2e-6, rel=0.2)


def test_a_signal_that_shrinks_follows_no_line() -> None:
    assert fit_line([3.0, 2.0, 1.0], [1.0, 2.0, 3.0]).agree.sum() < 3
