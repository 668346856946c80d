"""Tests of the shadow forecast: an effect that the rig has is kept, another one is taken back."""

import numpy as np
import pytest
from diagnosis_examples import SMALL
from mending_examples import weak_pump

from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rates.wells import WellRate
from porotwin_diagnosis.mending.shadow_forecast import (
    LEAST_WATCHED,
    WATCHED,
    ShadowForecast,
    ShadowJudgement,
)
from porotwin_solver.model.model import Model

GRID = SMALL.grid(47, 28)
RATES = {'injector': WellRate(1.4e-7, 1.0), 'producer': WellRate(-1.4e-7)}
INTERVAL_S = 60.0


def photographs(*effects, count):
    """Yield maps with noise of a rig with `effects`, and the rates before each of them."""
    model, random = Model(SMALL, GRID, preset='fast', effects=effects), np.random.default_rng(4)
    state = model.predict(model.initial_condition(), RATES, 1200.0)
    for number in range(count):
        begin = number * INTERVAL_S
        yield (
            state + 0.01 * random.standard_normal(state.shape),
            [RatePeriod(begin - INTERVAL_S, begin, RATES)] if number else [],
        )
        state = model.predict(state, RATES, INTERVAL_S)


@pytest.fixture
def shadow():
    mended = Model(SMALL, GRID, preset='fast', effects=[weak_pump()])
    return ShadowForecast(mended, Model(SMALL, GRID, preset='fast'))


def test_an_effect_that_the_rig_has_is_kept(shadow):
    judged = [shadow.see(*seen) for seen in photographs(weak_pump(0.75), count=WATCHED + 1)]
    assert judged[-1] is ShadowJudgement.KEPT
    assert set(judged[:-1]) == {ShadowJudgement.WATCHING}
    assert shadow.errors[0] < 0.8 * shadow.errors[1]
    assert f'forecasts of {WATCHED} photographs erred by' in shadow.in_words


def test_an_effect_that_the_rig_has_not_is_taken_back_soon(shadow):
    judged = [shadow.see(*seen) for seen in photographs(count=WATCHED + 1)]
    assert judged.index(ShadowJudgement.WORSE) <= LEAST_WATCHED + 1


def test_an_interruption_begins_with_the_next_photograph(shadow):
    seen = list(photographs(weak_pump(), count=6))
    for observed, periods in seen[:3]:
        shadow.see(observed, periods)
    shadow.interrupt()
    assert shadow.see(*seen[5]) is ShadowJudgement.WATCHING
    assert shadow.photographs == 2


def test_a_photograph_without_any_tracer_judges_nothing(shadow):
    shadow.see(np.zeros(GRID.shape), [])
    still = [RatePeriod(0.0, 30.0, {})]
    assert shadow.see(np.zeros(GRID.shape), still) is ShadowJudgement.WATCHING
    assert shadow.photographs == 0
