"""Tests of the balance between the tracer in a photograph and the tracer by the pumps."""

import numpy as np

from porotwin_hub.estimation.tracer_balance import imbalance

PORES = np.full((4, 5), 1e-5)
PLUME = np.zeros((4, 5))
PLUME[1:3, 1:4] = 1.0


def test_a_photograph_that_agrees_is_not_remarked() -> None:
    assert imbalance(PLUME, PLUME, PORES) == ''
    assert imbalance(0.8 * PLUME, PLUME, PORES) == ''
    assert imbalance(0.02 * PLUME, 0.0 * PLUME, PORES) == ''


def test_tracer_that_vanishes_or_appears_is_named_with_both_volumes() -> None:
    assert 'shows 3 ml of tracer, and by the pumps it would be 60 ml' in imbalance(
        0.05 * PLUME, PLUME, PORES
    )
    assert 'shows 60 ml of tracer, and by the pumps it would be 0 ml' in imbalance(
        PLUME, 0.0 * PLUME, PORES
    )


def test_cells_that_were_not_seen_do_not_count() -> None:
    covered = np.where(np.arange(5) < 3, np.nan, PLUME)
    assert imbalance(covered, PLUME, PORES) == ''
