"""The sequence of photographs: which one follows the last state, and when the sequence restarts.

A photograph between those already read is late and left out. If all new photographs lie before the
last one, the clock was set back; if the distance in time is too long, photographs are missing. In
both cases the next state does not follow from the last one, and a new sequence starts.

The functions are pure: the state of the sequence is an argument and a result.
"""

import statistics
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

from porotwin_core.clock.photo_interval import LONGEST_GAP_INTERVALS, LONGEST_GAP_S
from porotwin_core.clock.stamps import SAME_STAMP_S

REMEMBERED = 16
"""Number of states whose times and digests are remembered."""


@dataclass(frozen=True)
class SequenceState:
    """The memory of a sequence of photographs.

    Attributes:
        times: exposure times of the last states since the start of the sequence [s].
        digests: digests of their files, also of states before the start of the sequence.
        earlier_time: time of a photograph that was left out because it lies before the last state
            [s]; a second one shows that the clock was set back.
    """

    times: tuple[float, ...] = ()
    digests: tuple[str, ...] = ()
    earlier_time: float | None = None


@dataclass(frozen=True)
class Placement:
    """The place of a photograph in the sequence.

    Attributes:
        action: 'next' if it follows the last state, 'start' if it starts a sequence, 'ignore' if
            it must be left out.
        time_step: time since the last state [s], 0 unless the action is 'next'.
        reason: one line, empty if the action is 'next'.
        is_new_experiment: whether an experiment starts with the sequence: with the first one, and
            after more than a week, as when the camera's clock was mended.
    """

    action: Literal['next', 'start', 'ignore']
    time_step: float = 0.0
    reason: str = ''
    is_new_experiment: bool = False


def place(
    time: float,
    digest: str,
    state: SequenceState,
    *,
    longest_gap_s: float | None = None,
    replayed: bool = False,
) -> tuple[Placement, SequenceState]:
    """Return the place of a photograph, and the memory with the photograph taken note of.

    Args:
        time: exposure time [s].
        digest: digest of the file.
        state: memory of the sequence.
        longest_gap_s: longest time without photographs [s]; None: from the usual interval.
        replayed: whether the photographs are those of a recording, which may be played again.
    """
    if replayed and _begins_again(time, state):
        reason = f'the recording begins again at {time:.3f} s'
        return Placement('start', reason=reason), SequenceState()
    if digest in state.digests:
        return Placement('ignore', reason=f'photograph at {time:.3f} s is a duplicate'), state
    if not state.times:
        return Placement('start', reason='first photograph', is_new_experiment=True), state
    last = state.times[-1]
    if abs(time - last) < SAME_STAMP_S:
        return Placement('ignore', reason=f'second photograph stamped {time:.3f} s'), state
    if time < last:
        return _place_earlier(time, state)
    gap = _usual_gap(state.times) if longest_gap_s is None else longest_gap_s
    is_new = time - last > LONGEST_GAP_S
    if is_new or (gap is not None and time - last > gap):
        reason = f'{time - last:.0f} s without a photograph: some are missing'
        return Placement('start', reason=reason, is_new_experiment=is_new), state
    return Placement('next', time - last), state


def accept(time: float, digest: str, placement: Placement, state: SequenceState) -> SequenceState:
    """Return the memory after the photograph has become a state."""
    before = () if placement.action == 'start' else state.times
    return SequenceState((*before, time)[-REMEMBERED:], (*state.digests, digest)[-REMEMBERED:])


def _begins_again(time: float, state: SequenceState) -> bool:
    """Return whether a photograph at `time` [s] is the first one of the sequence, or before it."""
    if not state.times or time > state.times[0] + SAME_STAMP_S:
        return False
    return time < state.times[-1] - SAME_STAMP_S


def _place_earlier(time: float, state: SequenceState) -> tuple[Placement, SequenceState]:
    """Return the place of a photograph before the last state."""
    last = state.times[-1]
    repeated = state.earlier_time is not None and state.earlier_time < time
    if time < state.times[0] - SAME_STAMP_S or repeated:
        reason = f'the clock went back from {last:.3f} s to {time:.3f} s'
        is_new = last - time > LONGEST_GAP_S
        return Placement('start', reason=reason, is_new_experiment=is_new), state
    reason = f'photograph at {time:.3f} s is out of order: {last:.3f} s was read'
    return Placement('ignore', reason=reason), replace(state, earlier_time=time)


def _usual_gap(times: tuple[float, ...]) -> float | None:
    """Return the longest usual time between photographs [s], None if it is not known yet."""
    steps = [later - earlier for earlier, later in pairwise(times)]
    return LONGEST_GAP_INTERVALS * statistics.median(steps) if steps else None
