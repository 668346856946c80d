"""The scale of the signal from the mass balance of an injection."""

import numpy as np
import pytest

from porotwin_core.errors import InputError
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_imaging.mass_balance_fit import fit_growth, fit_response, injected_volume

PORE_VOLUME_M3 = 4e-8


def plumes() -> list[np.ndarray]:
    z, x = np.mgrid[-1:1:80j, -1:1:120j]
    shapes = ((0.2, 0.05), (0.3, 0.1), (0.4, 0.2), (0.5, 0.1), (0.6, 0.3), (0.7, 0.2))
    return [0.5 * (1 - np.tanh((np.hypot(x, z) - radius) / width)) for radius, width in shapes]


def test_injected_volume_counts_stock_only() -> None:
    schedule = Schedule(
        (
            ScheduleRow(0.0, 'a', WellRate(1e-6, 0.5)),
            ScheduleRow(0.0, 'b', WellRate(-1e-6, 1.0)),
            ScheduleRow(100.0, 'a', WellRate(2e-6, 1.0)),
            ScheduleRow(150.0, 'a', WellRate(5e-6, 0.0)),
        )
    )
    assert injected_volume(schedule, 0.0, 200.0) == pytest.approx(50e-6 + 100e-6)


def test_the_scale_is_found_despite_outliers() -> None:
    volume = np.linspace(1, 10, 10) * 1e-5
    imaged = volume / 0.8
    imaged[[2, 7]] *= [1.6, 0.3]
    growth = fit_growth(imaged, volume)
    assert growth.scale == pytest.approx(0.8, rel=1e-6)
    assert list(np.flatnonzero(~growth.inliers)) == [2, 7]


def test_signal_that_does_not_grow_is_refused() -> None:
    with pytest.raises(InputError, match='does not grow'):
        fit_growth([3.0, 2.0, 1.0], [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match='at least'):
        fit_growth([1.0, 2.0], [1.0, 2.0])


def test_a_bent_signal_gives_a_monotone_curve_that_balances_mass() -> None:
    truth = plumes()
    signals = [0.7 * (1 - np.exp(-1.5 * c)) / (1 - np.exp(-1.5)) for c in truth]
    volume = np.full(truth[0].shape, PORE_VOLUME_M3)
    injected = [float((c * volume).sum()) for c in truth]
    growth = fit_growth([float((s * volume).sum()) for s in signals], injected)
    response, misfit = fit_response(signals, volume, injected, scale=growth.scale)
    assert misfit < 0.02
    assert (np.diff(response.concentration) >= 0).all()
    error = [response.concentration_of(s) - c for s, c in zip(signals, truth, strict=True)]
    straight = [growth.scale * s - c for s, c in zip(signals, truth, strict=True)]
    assert np.linalg.norm(error) < np.linalg.norm(straight)
