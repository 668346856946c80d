"""The place of each photograph in the sequence."""

import pytest

from porotwin_imaging.live.photo_sequence import SequenceState, accept, place


def placements(times: list[float], longest_gap_s: float | None = None) -> list[tuple[str, float]]:
    """Return action and time step of photographs with different content."""
    state = SequenceState()
    found = []
    for number, time in enumerate(times):
        placement, state = place(time, str(number), state, longest_gap_s=longest_gap_s)
        if placement.action != 'ignore':
            state = accept(time, str(number), placement, state)
        found.append((placement.action, placement.time_step))
    return found


def test_states_follow_each_other_by_their_time_steps() -> None:
    assert placements([100.0, 130.0, 160.5]) == [('start', 0.0), ('next', 30.0), ('next', 30.5)]


def test_missing_photographs_start_a_new_sequence() -> None:
    assert placements([0, 30, 60, 400, 430])[3:] == [('start', 0.0), ('next', 30.0)]
    assert placements([0, 30, 60, 240])[3] == ('next', 180.0)  # a few are missing
    assert placements([0, 30, 60, 120], longest_gap_s=40.0)[3] == ('start', 0.0)


@pytest.mark.parametrize('wrong', [0.0, 4e9])
def test_a_clock_that_was_wrong_by_more_than_a_week_begins_another_experiment(wrong: float) -> None:
    state, found = SequenceState(), []
    for time in (wrong, wrong + 30.0, 1.7e9, 1.7e9 + 30.0):
        placement, state = place(time, f'{time}', state)
        state = accept(time, f'{time}', placement, state)
        found.append((placement.action, placement.is_new_experiment))
    assert found == [('start', True), ('next', False)] * 2


def test_a_late_photograph_is_left_out_and_the_next_one_follows() -> None:
    assert placements([0, 30, 90, 60, 120])[3:] == [('ignore', 0.0), ('next', 30.0)]


def test_a_clock_that_was_set_back_starts_a_new_sequence() -> None:
    assert placements([1000, 1030, 1060, 500, 530])[3:] == [('start', 0.0), ('next', 30.0)]
    # after a small step back the first photograph may be late; the second one proves the step
    assert placements([0, 30, 60, 90, 120, 50, 80])[5:] == [('ignore', 0.0), ('start', 0.0)]


def test_duplicates_are_left_out() -> None:
    placement, state = place(0.0, 'a', SequenceState())
    state = accept(0.0, 'a', placement, state)
    assert place(0.0, 'b', state)[0].action == 'ignore'
    assert 'duplicate' in place(30.0, 'a', state)[0].reason
    assert place(0.0, 'a', SequenceState())[0].action == 'start'


def test_a_recording_that_is_played_again_begins_again_with_its_first_photograph() -> None:
    state, found = SequenceState(), []
    for time in (0.0, 30.0, 60.0, 0.0, 30.0, 60.0):
        placement, state = place(time, f'photograph at {time}', state, replayed=True)
        if placement.action != 'ignore':
            state = accept(time, f'photograph at {time}', placement, state)
        found.append(placement.action)
    assert found == ['start', 'next', 'next'] * 2


def test_a_duplicate_of_the_last_photograph_is_left_out_of_a_replay_too() -> None:
    placement, state = place(0.0, 'a', SequenceState(), replayed=True)
    state = accept(0.0, 'a', placement, state)
    assert place(0.0, 'a', state, replayed=True)[0].action == 'ignore'
