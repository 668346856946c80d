"""Rates that nobody measured, on relative maps of the virtual rig."""

import pytest

from lab.photographs.hidden_rates import PRIOR_ML_H, SPREADING, hidden, posterior, tank
from porotwin_diagnosis.model.unknown_rates import settled
from porotwin_recording.experiment.recording import Recording


@pytest.fixture(scope='module')
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, dict[str, float]]:
    folder = tmp_path_factory.mktemp('hidden') / 'run'
    return hidden(tank(PRIOR_ML_H, SPREADING), 14, folder)


@pytest.mark.slow
def test_posterior_is_narrower_than_its_prior_and_holds_the_truth(
    made: tuple[Recording, dict[str, float]],
) -> None:
    recording, truth = made
    rates = posterior(recording)
    assert {rate.well for rate in rates} == set(truth)
    for rate in rates:
        (low, high), (least, most) = rate.interval_ml_h, rate.prior_ml_h
        assert low < truth[rate.well] < high
        assert high / low < 0.5 * most / least


@pytest.mark.slow
def test_search_begins_at_the_fitted_rates_and_tells_what_the_scale_hides(
    made: tuple[Recording, dict[str, float]],
) -> None:
    start = settled([made[0]])
    assert [one.name for one in start.recordings[0].rig.effects] == ['dispersion', 'rate', 'rate']
    (sample,) = start.samples
    assert sample.rate_modes is not None
    assert sample.rate_modes.shape == (2, *sample.observed.shape)
    paler = 0.5 * sample.observed_or_zero
    assert sample.relative_error(paler) == pytest.approx(0.0, abs=1e-9), 'the scale is open'
    assert 'relative scale' in start.told([])[0]
