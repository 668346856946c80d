"""Frames: usable pairs, mean rates over an interval, and rates as a vector."""

import dataclasses
from collections import Counter

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_costa.data.frames import (
    Frames,
    enough_seen,
    frame_pairs,
    left_out,
    rate_vector,
    same_time_step,
)


def test_rate_vector_has_the_order_of_the_wells():
    rates = {'b': WellRate(2e-7, 0.5), 'c': WellRate(-1e-7, 1.0)}
    assert rate_vector(rates, ('a', 'b', 'c')).tolist() == [[0, 0], [2e-7, 1e-7], [-1e-7, 0]]


def test_unknown_well_is_refused_only_if_it_pumps():
    with pytest.raises(InputError, match=r"'new'.*a, b"):
        rate_vector({'new': WellRate(1e-7)}, ('a', 'b'))
    assert rate_vector({'new': WellRate()}, ('a',)).sum() == 0


def test_frames_have_a_name_by_default():
    assert isinstance(Frames(np.zeros(1), np.zeros((1, 1, 1)), Schedule()).name, str)


def test_pairs_know_whether_they_follow_each_other():
    times = np.array([0.0, 30.0, 60.0, 120.0, 150.0, 180.0, 210.0])
    frames = Frames(times, np.zeros((7, 2, 2)), Schedule(), clean_times=(170.0,))
    dropped: Counter[str] = Counter()
    pairs = list(frame_pairs(frames, 30.0, dropped))
    assert [pair.number for pair in pairs] == [0, 1, 3, 5]
    assert [pair.follows for pair in pairs] == [False, True, False, False]
    assert [pair.sequence for pair in pairs] == [0, 0, 0, 1]
    assert dropped == {'pairs not 30 s apart': 1, 'pairs across an interruption': 1}


def test_pairs_with_a_map_that_shows_too_little_are_left_out():
    concentration = np.zeros((3, 2, 4))
    concentration[0, :, 1:] = np.nan
    frames = Frames(np.arange(3) * 30.0, concentration, Schedule())
    dropped: Counter[str] = Counter()
    assert [pair.number for pair in frame_pairs(frames, 30.0, dropped)] == [1]
    assert left_out(dropped) == '1 pairs with too little seen'
    shown = dataclasses.replace(frames, concentration=np.zeros((3, 2, 4)))
    assert len(list(frame_pairs(shown, 30.0, dropped))) == 2


def test_half_of_the_cells_is_enough():
    half = np.array([[0.0, np.nan], [0.0, np.nan]])
    assert enough_seen(half)
    half[0, 0] = np.nan
    assert not enough_seen(half)


def test_time_steps_agree_within_two_percent():
    assert same_time_step(30.0, 30.5)
    assert not same_time_step(30.0, 31.0)
