"""The search for a leak: where and how large one is tried."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rig import Boundaries
from porotwin_solver.effects.definition.candidate import SearchContext
from porotwin_solver.effects.leak import trials


def context(rig, rate_ml_h: float) -> SearchContext:
    """Return an hour on `rig` whose strongest pump runs at `rate_ml_h`."""
    return SearchContext(rig, rig.grid(93, 56), 3600.0, strongest_rate=from_ml_h(rate_ml_h))


def test_a_gain_and_a_loss_are_tried_in_proportion_to_the_strongest_pump(rig) -> None:
    tried = trials(context(rig, 500.0), (0.3, 0.2))
    parameters = [trial.described(trial.first).parameters for trial in tried]
    assert [values['rate'] for values in parameters] == pytest.approx([25.0, -25.0])
    assert all((values['x'], values['z']) == (0.3, 0.2) for values in parameters)


def test_a_rig_at_rest_offers_no_size_for_a_leak(rig) -> None:
    with pytest.raises(InputError, match='no pump ever runs'):
        trials(context(rig, 0.0), (0.3, 0.2))


def test_a_closed_rig_cannot_leak(make_rig) -> None:
    with pytest.raises(InputError, match='closed on all sides'):
        trials(context(make_rig(boundaries=Boundaries(top='closed')), 500.0), (0.3, 0.2))
