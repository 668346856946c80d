"""Which photograph follows which."""

from porotwin_imaging.sequence import StateSequence, Waiting


def run(times: list[float], longest_gap: float | None = None) -> list[tuple[str, float]]:
    sequence = StateSequence(longest_gap)
    verdicts = []
    for number, time in enumerate(times):
        verdict = sequence.judge(time, str(number))
        if verdict.action != 'ignore':
            sequence.accept(time, str(number), verdict)
        verdicts.append((verdict.action, verdict.time_step))
    return verdicts


def test_states_follow_each_other_by_their_time_steps() -> None:
    assert run([100.0, 130.0, 160.5]) == [('start', 0.0), ('next', 30.0), ('next', 30.5)]


def test_missing_photographs_begin_a_new_sequence() -> None:
    assert run([0, 30, 60, 200, 230])[3:] == [('start', 0.0), ('next', 30.0)]
    assert run([0, 30, 60, 120])[3] == ('next', 60.0)  # one was left out
    assert run([0, 30, 60, 120], longest_gap=40.0)[3] == ('start', 0.0)


def test_a_late_photograph_is_left_out_and_the_stream_goes_on() -> None:
    assert run([0, 30, 90, 60, 120])[3:] == [('ignore', 0.0), ('next', 30.0)]


def test_a_clock_set_back_begins_a_new_sequence() -> None:
    assert run([1000, 1030, 1060, 500, 530])[3:] == [('start', 0.0), ('next', 30.0)]
    # set back by little: the first photograph may be late, the second shows that time runs there
    assert run([0, 30, 60, 90, 120, 50, 80])[5:] == [('ignore', 0.0), ('start', 0.0)]


def test_duplicates_are_left_out() -> None:
    sequence = StateSequence()
    sequence.accept(0.0, 'a', sequence.judge(0.0, 'a'))
    assert sequence.judge(0.0, 'b').action == 'ignore'
    assert 'duplicate' in sequence.judge(30.0, 'a').reason
    sequence.restart()
    assert sequence.judge(0.0, 'a').action == 'start'


def test_photographs_that_wait_say_so_once_and_again_when_some_are_lost() -> None:
    waiting = Waiting(room=3)
    said = [waiting.add(float(time), b'%d' % time) for time in range(6)]
    assert [bool(line) for line in said] == [True, False, False, True, False, False]
    assert said[0].startswith('no baseline yet, photographs wait for one: take a photograph')
    assert 'the oldest that wait for one are left out' in said[3]
    assert waiting.release() == [(3.0, b'3'), (4.0, b'4'), (5.0, b'5')]
    assert waiting.release() == []
    assert waiting.add(6.0, b'6') == said[0]
