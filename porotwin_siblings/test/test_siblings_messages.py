"""Tests of the messages of the siblings: other maps are refused with one line."""

import numpy as np
import pytest
from siblings_examples import EMPTY, GRID

from porotwin_core.basis.errors import InputError

pytest.importorskip('porotwin_msgs', reason='needs ROS 2; set it up with ./porotwin')

from porotwin_core.model.state_filter import Seen
from porotwin_core.ros import conversions
from porotwin_msgs.msg import NewState
from porotwin_siblings.siblings_messages import photograph_from_msg


@pytest.mark.parametrize(
    ('concentration', 'noise', 'complaint'),
    [
        (np.full(GRID.shape, np.nan), 0.01, 'its map shows no cell'),
        (EMPTY, -1.0, 'its noise is -1; send 0 or more'),
        (EMPTY, np.inf, 'its noise is inf'),
    ],
)
def test_what_shows_nothing_is_refused(
    concentration: np.ndarray, noise: float, complaint: str
) -> None:
    tracer = conversions.tracer_to_msg(concentration, GRID, 30.0)
    with pytest.raises(InputError, match=complaint):
        photograph_from_msg(NewState(tracer=tracer, noise=noise), GRID)


def test_noise_that_is_not_known_is_no_mistake() -> None:
    tracer = conversions.tracer_to_msg(EMPTY, GRID, 30.0)
    message = NewState(header=tracer.header, tracer=tracer, noise=np.nan)
    assert photograph_from_msg(message, GRID).time == 30.0


def test_siblings_see_the_deviations_that_the_hub_sees() -> None:
    deviation = np.full(GRID.shape, 0.05)
    told = [deviation.ravel().tolist(), []]
    for one, given in zip(told, (deviation, None), strict=True):
        tracer = conversions.tracer_to_msg(EMPTY + 0.5, GRID, 30.0)
        found = photograph_from_msg(NewState(tracer=tracer, deviation=one), GRID)
        seen = Seen.of(EMPTY + 0.5, given, None)
        assert found.random == pytest.approx(seen.random)
        assert found.systematic == pytest.approx(seen.systematic)
