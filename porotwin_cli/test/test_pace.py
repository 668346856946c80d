"""Tests of the warning about a twin that cannot keep pace with its camera."""

import logging

import pytest

from porotwin_cli.running.pace import tell_pace
from porotwin_cli.workspace import small_rig
from porotwin_core.rig import load_rig

RIG = load_rig(small_rig())


@pytest.mark.parametrize(('interval', 'told'), [(30.0, False), (1e-5, True)])
def test_a_prediction_that_is_long_beside_the_interval_is_told(
    interval: float, told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, logger='porotwin'):
        tell_pace(RIG, RIG.grid(94, 56), 'fast', interval)
    assert ('choose a coarser --grid' in caplog.text) is told
