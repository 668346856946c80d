"""Tests of the balance between the tracer in a photograph and the tracer by the pumps."""

import numpy as np
import pytest

from porotwin_hub.estimation.tracer_balance import imbalance

PORES = np.full((4, 5), 1e-5)
PLUME = np.zeros((4, 5))
PLUME[1:3, 1:4] = 1.0


def test_a_photograph_that_agrees_is_not_remarked() -> None:
    assert imbalance(PLUME, PLUME, PORES) is None
    assert imbalance(0.8 * PLUME, PLUME, PORES) is None
    assert imbalance(0.02 * PLUME, 0.0 * PLUME, PORES) is None


def test_tracer_that_vanishes_or_appears_is_named_with_both_volumes() -> None:
    for found, predicted, code in (
        (0.05 * PLUME, PLUME, 'too_little_tracer'),
        (PLUME, 0.0 * PLUME, 'too_much_tracer'),
    ):
        remark = imbalance(found, predicted, PORES)
        assert remark is not None
        assert remark.code == code
        assert remark.facts['held_ml'] == pytest.approx(found.sum() * 10.0)
        assert remark.facts['pumped_ml'] == pytest.approx(predicted.sum() * 10.0)


def test_cells_that_were_not_seen_do_not_count() -> None:
    covered = np.where(np.arange(5) < 3, np.nan, PLUME)
    assert imbalance(covered, PLUME, PORES) is None
