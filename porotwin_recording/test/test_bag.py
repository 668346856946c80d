"""Tests of the experiment in a bag: a live bag is read, and its faults are named."""

import itertools
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording_examples import controlled_rig, write_live_bag
from sensor_msgs.msg import CompressedImage

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import write_rig
from porotwin_core.ros.conversions import rates_to_msg, rig_to_msg
from porotwin_msgs.msg import CleanState, NewState, Setpoint, WellRates
from porotwin_recording.experiment.bag import foreign_positions
from porotwin_recording.experiment.bag_conversion import export_bag
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.serialization import SECOND


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    write_rig(controlled_rig(), tmp_path / 'rig.yaml')
    return tmp_path / 'rig.yaml'


def stamped(message: object, stamp: int) -> object:
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
    return message


def state(stamp: int, value: float) -> NewState:
    message = stamped(NewState(), stamp)
    message.tracer.grid.nx = message.tracer.grid.nz = 2
    message.tracer.grid.width, message.tracer.grid.height = 0.4, 0.3
    message.tracer.concentration = [value] * 4
    return message


def test_a_live_bag_counts_time_from_its_clean_start(tmp_path: Path) -> None:
    begin = 50 * SECOND
    start = stamped(CleanState(cause=CleanState.START), begin)
    setpoint = stamped(Setpoint(wells=rates_to_msg({'in': WellRate(1e-7, 1.0)})), begin - SECOND)
    measured = WellRates(wells=rates_to_msg({'in': WellRate(0.9e-7, 1.0)}))
    measured.start.sec = 50
    write_live_bag(
        tmp_path / 'run.mcap',
        [
            ('/lab/rig/description', rig_to_msg(controlled_rig())),
            ('/lab/wells/setpoint', setpoint),
            ('/lab/asset/clean_state', start),
            ('/lab/asset/new_state', state(begin, 0.0)),
            ('/lab/asset/new_state', state(begin + 2 * SECOND, 0.5)),
            ('/lab/wells/measured', stamped(measured, begin + 2 * SECOND)),
            ('/lab/asset/new_state', state(begin + SECOND, 0.25)),
            ('/lab/asset/new_state', state(begin + 2 * SECOND, 0.75)),
        ],
    )
    recording = open_recording(tmp_path / 'run.mcap')
    assert recording.times.tolist() == [0.0, 1.0, 2.0]
    assert recording.concentration[:, 0, 0].tolist() == [0.0, 0.25, 0.75]
    assert recording.schedule.rows == (ScheduleRow(0.0, 'in', WellRate(1e-7, 1.0)),)
    pumped = WellRate(0.9e-7, 1.0)
    assert recording.measured == Schedule(tuple(ScheduleRow(at, 'in', pumped) for at in (0.0, 2.0)))
    assert not recording.by_hand


def clean(stamp: int, cause: int = CleanState.START) -> object:
    return stamped(CleanState(cause=cause), stamp)


def write_states(path: Path, *runs: list[tuple[int, float]], wrong_order: bool = False) -> Path:
    """Write runs of states (stamp [s], value); each run begins with a clean start."""
    messages = [('/lab/rig/description', rig_to_msg(controlled_rig()))]
    for run in runs:
        states = [('/lab/asset/new_state', state(stamp * SECOND, value)) for stamp, value in run]
        begin = ('/lab/asset/clean_state', clean(run[0][0] * SECOND))
        messages += [states[0], begin, *states[1:]] if wrong_order else [begin, *states]
    write_live_bag(path, messages)
    return path


@pytest.mark.parametrize('wrong_order', [False, True])
def test_a_sequence_that_begins_again_goes_on(tmp_path: Path, wrong_order: bool) -> None:
    runs = [(100, 0.1), (130, 0.2)], [(160, 0.3), (190, 0.4)], [(220, 0.5)]
    bag = write_states(tmp_path / 'run.mcap', *runs, wrong_order=wrong_order)
    recording = open_recording(bag)
    assert recording.times.tolist() == [0, 30, 60, 90, 120]
    assert '3 parts of one experiment joined' in recording.remarks[0]
    assert 'at 60, 120 s' in recording.remarks[0]


@pytest.mark.parametrize('wrong_order', [False, True])
def test_photographs_that_are_sent_again_replace_the_earlier_ones(
    tmp_path: Path, wrong_order: bool
) -> None:
    now = 1_700_000_000
    runs = [(now, 0.1), (now + 30, 0.2)], [(now, 0.3), (now + 30, 0.4), (now + 60, 0.5)]
    bag = write_states(tmp_path / 'run.mcap', *runs, wrong_order=wrong_order)
    recording = open_recording(bag)
    assert recording.times.tolist() == [0, 30, 60]
    assert recording.concentration[:, 0, 0].tolist() == pytest.approx([0.3, 0.4, 0.5])


@pytest.mark.parametrize('wrong_order', [False, True])
def test_the_longest_of_several_experiments_is_read_unless_one_is_chosen(
    tmp_path: Path, wrong_order: bool
) -> None:
    runs = [(1, 0.25), (2, 0.25)], [(1, 0.75), (2, 0.75), (3, 0.75)]
    bag = write_states(tmp_path / 'run.mcap', *runs, wrong_order=wrong_order)
    recording = open_recording(bag)
    assert recording.concentration[:, 0, 0].tolist() == [0.75, 0.75, 0.75]
    assert 'holds 2 experiments (1 with 2 states; 2 with 3 states)' in recording.remarks[0]
    assert 'segment 2 is read' in recording.remarks[0]
    first = open_recording(bag, segment=1)
    assert first.concentration[:, 0, 0].tolist() == [0.25, 0.25]
    with pytest.raises(InputError, match='holds 2 experiments; choose a segment from 1 to 2'):
        open_recording(bag, segment=3)


@pytest.fixture
def two_experiments(tmp_path: Path) -> Path:
    """A bag with two experiments of a baseline, a photograph and a map; the photographs differ."""

    def photo(stamp: int) -> object:
        return stamped(CompressedImage(data=b'\xff\xd8' + bytes([stamp])), stamp * SECOND)

    messages = [('/lab/rig/description', rig_to_msg(controlled_rig()))]
    for begin in (100, 200):
        messages += [
            ('/lab/camera/baseline/compressed', photo(begin - 10)),
            ('/lab/camera/image/compressed', photo(begin)),
            ('/lab/asset/clean_state', clean(begin * SECOND)),
            ('/lab/asset/new_state', state(begin * SECOND, 0.5)),
        ]
    write_live_bag(tmp_path / 'run.mcap', messages)
    return tmp_path / 'run.mcap'


def test_an_interrupted_export_keeps_no_photograph_for_another_experiment(
    two_experiments: Path, tmp_path: Path
) -> None:
    def stop(done: int, total: int) -> None:
        if done == total:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export_bag(two_experiments, tmp_path / 'out', segment=1, progress=stop)
    export_bag(two_experiments, tmp_path / 'out', segment=2)
    photos = open_recording(tmp_path / 'out').photos
    assert [photo.read()[-1] for photo in photos] == [190, 200]


def test_a_new_baseline_begins_another_experiment(two_experiments: Path, tmp_path: Path) -> None:
    for segment in (1, 2):
        recording = open_recording(tmp_path / 'run.mcap', segment=segment)
        assert recording.times.tolist() == [0.0]
        assert [(photo.role, photo.time) for photo in recording.photos] == [
            ('baseline', -10.0),
            ('state', 0.0),
        ]


def rewritten(path: Path, change: Callable[[int, str, bytes], bytes]) -> Path:
    """Return a copy of a bag whose messages (number, topic, bytes) went through `change`."""
    with BagWriter(path.with_name('changed')) as writer:
        bag = BagReader(path)
        for name, topic in bag.topics.items():
            writer.add_topic(name, topic.type_name, definition=topic.definition)
        for number, message in enumerate(bag.messages()):
            data = change(number, message.topic, message.data)
            writer.write(message.topic, data, log_time=number)
    return path.with_name('changed')


def test_a_message_that_cannot_be_read_costs_itself(tmp_path: Path) -> None:
    path = write_states(tmp_path / 'run.mcap', [(1, 0.1), (2, 0.2)], [(3, 0.3)])
    first_clean = 1

    def change(number: int, topic: str, data: bytes) -> bytes:
        return b'\x00\x01\x00\x00\x07' if number == first_clean else data

    recording = open_recording(rewritten(path, change))
    assert recording.times.tolist() == [0.0, 1.0, 2.0]
    assert "1 messages of '/lab/asset/clean_state' left out" in recording.remarks[0]


@pytest.mark.parametrize('kept', [(), (2,), (0, 1, 3)])
def test_states_that_cannot_be_read_cost_themselves_with_a_line(
    tmp_path: Path, kept: tuple[int, ...], caplog: pytest.LogCaptureFixture
) -> None:
    path = write_states(tmp_path / 'run.mcap', [(1, 0.1), (2, 0.2), (3, 0.3), (4, 0.4)])
    states = itertools.count()

    def change(_: int, topic: str, data: bytes) -> bytes:
        cut = topic.endswith('new_state') and next(states) not in kept
        return data[: len(data) // 2] if cut else data

    recording = open_recording(rewritten(path, change))
    if not kept:
        assert recording.maps is None
        assert 'none of 4 states can be read' in recording.remarks[0]
        return
    seen = np.isfinite(recording.concentration).all(axis=(1, 2))
    assert list(seen).count(True) == len(kept)
    told = [*recording.remarks, *caplog.messages]
    assert any('left out' in line or 'left unknown' in line for line in told)


def test_impossible_concentrations_of_a_bag_are_unknown(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_states(tmp_path / 'run.mcap', [(1, 0.1), (2, -1.5)])
    maps = open_recording(path).concentration
    assert np.isfinite(maps[0]).all()
    assert np.isnan(maps[1]).all()
    assert '4 of 8 values are read as not known' in caplog.text


def test_a_bag_without_a_rig_asks_for_one(rig_file: Path, tmp_path: Path) -> None:
    write_live_bag(tmp_path / 'run.mcap', [('/lab/asset/new_state', state(SECOND, 0.5))])
    with pytest.raises(InputError, match=r'holds no rig description; name its rig\.yaml'):
        open_recording(tmp_path / 'run.mcap')
    assert open_recording(tmp_path / 'run.mcap', rig=rig_file).times.tolist() == [0.0]
    other = controlled_rig().model_copy(update={'width_m': 0.9})
    with pytest.raises(InputError, match=r'maps cover 0.4 x 0.3 m, the rig 0.9 x 0.3 m'):
        open_recording(tmp_path / 'run.mcap', rig=other)


def test_a_bag_of_something_else_is_named(tmp_path: Path) -> None:
    from std_msgs.msg import String

    write_live_bag(tmp_path / 'run.mcap', [('/chatter', String(data='hello'))])
    with pytest.raises(InputError, match='holds no topic of a PoroTwin experiment'):
        open_recording(tmp_path / 'run.mcap')


def test_a_bag_of_two_rigs_is_named(tmp_path: Path) -> None:
    write_live_bag(
        tmp_path / 'run.mcap',
        [('/a/asset/new_state', state(SECOND, 0.5)), ('/b/asset/new_state', state(SECOND, 0.5))],
    )
    with pytest.raises(InputError, match='holds two rigs'):
        open_recording(tmp_path / 'run.mcap')


def test_a_bag_with_an_unknown_well_is_named(tmp_path: Path) -> None:
    rates = rates_to_msg({'inn': WellRate(1e-7, 1.0)})
    write_live_bag(
        tmp_path / 'run.mcap',
        [
            ('/lab/rig/description', rig_to_msg(controlled_rig())),
            ('/lab/wells/setpoint', stamped(Setpoint(wells=rates), SECOND)),
        ],
    )
    with pytest.raises(InputError, match="unknown well 'inn'; the rig has in, out, water"):
        open_recording(tmp_path / 'run.mcap')


def measured(stamp: int, well: str, rate: float) -> WellRates:
    message = stamped(WellRates(wells=rates_to_msg({well: WellRate(1e-7)})), stamp)
    message.start = message.header.stamp
    message.wells[0].rate = rate
    return message


def test_rates_that_the_hub_ignored_are_left_out(tmp_path: Path) -> None:
    write_live_bag(
        tmp_path / 'run.mcap',
        [
            ('/lab/rig/description', rig_to_msg(controlled_rig())),
            ('/lab/asset/clean_state', stamped(CleanState(cause=CleanState.START), SECOND)),
            ('/lab/wells/measured', measured(SECOND, 'in', 1e-7)),
            ('/lab/wells/measured', measured(2 * SECOND, 'in', float('nan'))),
            ('/lab/wells/measured', measured(3 * SECOND, 'inn', 2e-7)),
            ('/lab/wells/measured', measured(4 * SECOND, 'in', 3e-7)),
            ('/lab/asset/new_state', state(4 * SECOND, 0.5)),
        ],
    )
    recording = open_recording(tmp_path / 'run.mcap')
    assert recording.measured is not None
    assert [(row.time, row.rate.rate) for row in recording.measured.rows] == [(0, 1e-7), (3, 3e-7)]
    assert recording.by_hand
    assert len(recording.remarks) == 1
    assert "2 messages of rates left out: well 'in': well rate nan" in recording.remarks[0]


def test_rates_that_no_pump_can_have_are_left_out_of_a_bag(tmp_path: Path) -> None:
    write_live_bag(
        tmp_path / 'run.mcap',
        [
            ('/lab/rig/description', rig_to_msg(controlled_rig())),
            ('/lab/asset/clean_state', stamped(CleanState(cause=CleanState.START), SECOND)),
            ('/lab/wells/measured', measured(SECOND, 'in', 1e-7)),
            ('/lab/wells/measured', measured(2 * SECOND, 'in', 1.0)),
            ('/lab/asset/new_state', state(4 * SECOND, 0.5)),
        ],
    )
    recording = open_recording(tmp_path / 'run.mcap')
    assert recording.measured is not None
    assert {row.rate.rate for row in recording.measured.rows} == {1e-7}
    assert any('send m^3/s' in remark for remark in recording.remarks)


def test_a_wrong_rig_description_is_named_and_a_rig_yaml_replaces_it(
    rig_file: Path, tmp_path: Path
) -> None:
    description = rig_to_msg(controlled_rig())
    description.wells[0].radius = -1.0
    write_live_bag(
        tmp_path / 'run.mcap',
        [('/lab/rig/description', description), ('/lab/asset/new_state', state(SECOND, 0.5))],
    )
    with pytest.raises(InputError, match=r'wells\.in\.radius_m = -1\.0.*name its rig\.yaml'):
        open_recording(tmp_path / 'run.mcap')
    assert open_recording(tmp_path / 'run.mcap', rig=rig_file).times.tolist() == [0.0]


@pytest.mark.parametrize(
    ('numbers', 'foreign'),
    [
        ([1, 2, 777, 3, 1, 2, 3], [777]),
        ([1, 2, 777, 778, 3, 4], [777, 778]),
        ([1, 777, 2, 500, 3], [777, 500]),
        ([1, 2, 3, 1, 5], []),
        ([2, 1, 3], []),
        ([5, 1, 7], []),
    ],
)
def test_foreign_setpoints_are_told_from_new_hubs(numbers: list[int], foreign: list[int]) -> None:
    assert [numbers[position] for position in sorted(foreign_positions(numbers))] == foreign


@given(
    st.lists(
        st.lists(st.integers(1, 4), max_size=6).map(
            lambda steps: list(itertools.accumulate(steps, initial=1))
        ),
        max_size=5,
    )
)
def test_no_true_setpoint_of_restarted_hubs_is_left_out(hubs: list[list[int]]) -> None:
    assert not foreign_positions(itertools.chain.from_iterable(hubs))


@pytest.mark.parametrize('foreign_second', [3, 2])
def test_setpoints_that_no_hub_sent_are_left_out(tmp_path: Path, foreign_second: int) -> None:
    numbers = [1, 2, 777, 3, 1, 2, 3]  # a forged one, and a hub that began again
    seconds = [1, 2, foreign_second, 4, 5, 6, 7]
    rates = [rates_to_msg({'in': WellRate(number * 1e-9)}) for number in numbers]
    setpoints: list[tuple[str, object]] = [
        ('/lab/wells/setpoint', stamped(Setpoint(sequence=number, wells=wells), second * SECOND))
        for second, number, wells in zip(seconds, numbers, rates, strict=True)
    ]
    states = [('/lab/asset/new_state', state(second * SECOND, 0.5)) for second in (1, 9)]
    rig = ('/lab/rig/description', rig_to_msg(controlled_rig()))
    write_live_bag(tmp_path / 'run.mcap', [rig, *states[:1], *setpoints, *states[1:]])
    data = open_recording(tmp_path / 'run.mcap')
    assert data.commanded is not None
    assert [row.rate.rate for row in data.commanded.rows] == pytest.approx(
        [number * 1e-9 for number in (1, 2, 3, 1, 2, 3)]
    )
    assert any('the number 777' in line for line in data.remarks)


def test_two_copies_of_a_bag_in_one_folder_are_told(tmp_path: Path) -> None:
    folder = tmp_path / 'twice'
    folder.mkdir()
    write_states(folder / 'a.mcap', [(10, 0.1), (20, 0.2)])
    shutil.copyfile(folder / 'a.mcap', folder / 'b.mcap')
    data = open_recording(folder)
    assert len(data.maps) == 2
    assert any('2 maps and photographs are in it twice' in line for line in data.remarks)
