"""Tests of the mender: it asks, offers, lets act, takes back, and survives a solver that fails."""

import numpy as np
import pytest
from diagnosis_examples import SMALL
from mending_examples import finding, weak_pump

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rates.wells import WellRate
from porotwin_diagnosis.mending.mender import LEAST_MAPS, Mender, MendSettings, model_maker
from porotwin_diagnosis.mending.offer_book import OfferState
from porotwin_solver.model.model import Model

GRID = SMALL.grid(23, 14)
RATES = {'injector': WellRate(1.4e-7, 1.0), 'producer': WellRate(-1.4e-7)}
PERIODS = [RatePeriod(0.0, 120.0, RATES)]


class Desk:
    """A mender, and everything that it tells and sets."""

    def __init__(self):
        self.offers, self.lines, self.set = [], [], []
        self.fault = None
        self.mender = Mender(
            model_maker(SMALL, GRID, 'fast'),
            MendSettings(every_s=1200.0, least_confidence=0.9),
            set_effects=self._set,
            publish=self.offers.append,
            say=self.lines.append,
        )

    def _set(self, effects):
        if self.fault is not None:
            raise self.fault
        self.set.append(effects)

    def photographs(self, count, start=0.0, error=0.02):
        """Return the reasons for a diagnosis after `count` photographs."""
        stamps = [start + 30.0 * number for number in range(count)]
        return [self.mender.occasion(stamp, error, 0.02) for stamp in stamps]

    def offered(self):
        """Let a weak pump be offered after twenty minutes."""
        self.photographs(41)
        self.mender.found(finding(), seen=1200.0, now=1230.0, given=())

    def accepted(self):
        """Let an offer of a weak pump be accepted after twenty minutes."""
        self.offered()
        self.mender.answer(self.offers[-1].sequence, accept=True)


@pytest.fixture
def desk():
    return Desk()


def test_a_diagnosis_is_wanted_now_and_then_and_when_forecasts_leave_their_band(desk):
    assert [n for n, reason in enumerate(desk.photographs(41)) if reason] == [40]
    assert desk.photographs(12, start=1230.0) == [''] * 12
    reasons = desk.photographs(5, start=1590.0, error=0.2)
    assert [reason for reason in reasons if reason] == ['the forecasts have left their band']


def test_an_offer_about_another_model_or_another_experiment_is_void(desk):
    desk.offered()
    desk.mender.solver_tells((weak_pump(),), is_new=False)
    assert desk.offers[-1].state is OfferState.EXPIRED
    with pytest.raises(InputError, match='expired'):
        desk.mender.answer(1, accept=True)
    assert desk.set == [], 'the pump is not corrected twice'
    desk.mender.found(finding(weak_pump(0.5)), seen=1200.0, now=1230.0, given=(weak_pump(),))
    desk.mender.begin_anew()
    assert 'another experiment' in desk.offers[-1].sentence


def test_a_solver_that_answers_late_has_accepted(desk):
    desk.offered()
    desk.fault = TimeoutError('the solver did not answer')
    with pytest.raises(TimeoutError):
        desk.mender.answer(1, accept=True)
    assert desk.mender.waits
    desk.mender.solver_tells((weak_pump(),), is_new=False)
    assert desk.offers[-1].state is OfferState.ACCEPTED
    assert desk.mender.in_force == (weak_pump(),)
    assert desk.mender.watches


def test_few_photographs_are_not_diagnosed(desk):
    assert not any(desk.photographs(LEAST_MAPS - 1, error=0.5))


def test_an_accepted_effect_acts_and_is_kept_when_the_photographs_agree(desk):
    desk.accepted()
    assert desk.set == [(weak_pump(),)]
    assert desk.offers[-1].state is OfferState.ACCEPTED
    true = Model(SMALL, GRID, preset='fast', effects=[weak_pump()])
    state = true.predict(true.initial_condition(), RATES, 600.0)
    desk.mender.see(state, [])
    while desk.mender.watches:
        state = true.predict(state, RATES, 120.0)
        desk.mender.see(state, PERIODS)
    assert desk.offers[-1].state is OfferState.ACCEPTED
    assert 'Kept' in desk.offers[-1].sentence
    assert desk.mender.in_force == (weak_pump(),)


def worse_beside_a_silent_solver(desk):
    """Accept an effect that the rig does not have; return the rig's model and its last state."""
    desk.accepted()
    true = Model(SMALL, GRID, preset='fast')
    state = true.predict(true.initial_condition(), RATES, 600.0)
    desk.mender.see(state, [])
    desk.fault = TimeoutError('the solver is silent')
    for _ in range(6):
        state = true.predict(state, RATES, 120.0)
        desk.mender.see(state, PERIODS)
    return true, state


def test_an_effect_that_makes_forecasts_worse_is_taken_back_by_itself(desk):
    true, state = worse_beside_a_silent_solver(desk)
    assert any('tried again with the next photograph' in line for line in desk.lines)
    desk.fault = None
    desk.mender.see(true.predict(state, RATES, 120.0), PERIODS)
    assert desk.set[-1] == ()
    assert desk.offers[-1].state is OfferState.TAKEN_BACK
    assert not desk.mender.watches


def test_a_solver_that_answers_late_has_taken_back(desk):
    worse_beside_a_silent_solver(desk)
    assert desk.offers[-1].state is OfferState.ACCEPTED
    desk.mender.solver_tells((), is_new=False)
    assert desk.offers[-1].state is OfferState.TAKEN_BACK
    assert desk.mender.in_force == ()
    desk.mender.found(finding(), seen=2000.0, now=2000.0, given=())
    assert desk.offers[-1].state is OfferState.TAKEN_BACK, 'the cause is not offered again'


def test_effects_that_the_solver_refuses_are_refused(desk):
    desk.offered()
    desk.fault = TimeoutError('silent')
    with pytest.raises(TimeoutError):
        desk.mender.answer(1, accept=True)
    assert desk.mender.waits
    desk.fault = InputError('the solver refuses: a leak outside the rig')
    with pytest.raises(InputError, match='outside the rig'):
        desk.mender.answer(1, accept=True)
    assert desk.offers[-1].state is OfferState.REFUSED
    assert desk.mender.in_force == ()


def test_an_outdated_verdict_is_not_offered(desk):
    desk.photographs(41)
    desk.mender.found(finding(), seen=1200.0, now=4800.0, given=())
    desk.mender.begin_anew()
    desk.mender.found(finding(), seen=1200.0, now=1230.0, given=())
    assert not desk.offers
    assert all('outdated' in line for line in desk.lines)


def test_a_solver_that_was_started_again_gets_its_effects_again(desk):
    desk.accepted()
    desk.mender.solver_tells((weak_pump(),), is_new=False)
    desk.mender.solver_tells((), is_new=True)
    assert desk.set == [(weak_pump(),)] * 2
    desk.mender.solver_tells((), is_new=False)
    assert desk.mender.in_force == ()
    assert not desk.mender.watches


@pytest.mark.parametrize(
    ('true', 'told'),
    [((weak_pump(),), 'as good as without, or better'), ((), 'worse than without')],
)
def test_effects_from_before_a_restart_of_this_node_are_judged_and_stay(desk, true, told):
    desk.mender.solver_tells((weak_pump(),), is_new=False)
    assert desk.lines[-1].startswith('in force before this node began: ')
    model = Model(SMALL, GRID, preset='fast', effects=true)
    state = model.predict(model.initial_condition(), RATES, 600.0)
    desk.mender.see(state, [])
    while desk.mender.watches:
        state = model.predict(state, RATES, 120.0)
        desk.mender.see(state, PERIODS)
    assert told in desk.lines[-1]
    assert desk.mender.in_force == (weak_pump(),)
    assert not desk.set
    assert not desk.offers


def test_effects_that_a_solver_has_lost_are_set_with_the_next_photographs(desk):
    desk.accepted()
    desk.fault = TimeoutError('the solver does not run')
    for _ in range(2):  # it restarts once more
        desk.mender.solver_tells((), is_new=True)
    desk.mender.see(np.zeros(GRID.shape), [])
    assert desk.mender.in_force == (weak_pump(),)
    desk.fault = None
    for _ in range(2):
        desk.mender.see(np.zeros(GRID.shape), [])
    assert desk.set == [(weak_pump(),)] * 2
    assert desk.lines[-1] == 'the solver was started again; its effects are set again'


def test_a_verdict_on_a_model_that_has_changed_since_is_not_offered(desk):
    desk.accepted()
    desk.mender.found(finding(), seen=1200.0, now=1260.0, given=())
    assert len(desk.offers) == 2  # offered, accepted
    assert 'has changed since' in desk.lines[-1]


def test_a_wrong_photograph_stops_nothing(desk):
    desk.accepted()
    desk.mender.see(np.zeros(GRID.shape), [])
    desk.mender.see(np.zeros(GRID.shape), [RatePeriod(0.0, 30.0, {'nobody': WellRate(1e-9)})])
    assert 'no shadow forecast for this photograph' in desk.lines[-1]
