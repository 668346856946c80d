"""Tests of the selection of messages for a replay."""

from pathlib import Path

import pytest
from rclpy.serialization import deserialize_message
from recording_examples import write_string_bag

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import WellRate
from porotwin_core.ros.conversions import rates_from_msg, rates_to_msg
from porotwin_msgs.msg import Setpoint, WellRates
from porotwin_recording.live.player import as_measured, latched_before, played_topics
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.serialization import SECOND, Serializer

PHOTOS = ['/p/camera/image/compressed', '/p/camera/baseline/compressed']
STATES = ['/p/asset/new_state', '/p/asset/state_refreshed', '/p/asset/clean_state']
OTHERS = ['/clock', '/p/rig/description', '/p/wells/setpoint', '/p/tracer/predicted']


def test_photographs_and_measured_rates_are_the_inputs(tmp_path: Path) -> None:
    bag = write_string_bag(tmp_path / 'run', [*PHOTOS, *STATES, *OTHERS, '/p/wells/measured'])
    assert sorted(played_topics(bag, 'inputs')) == sorted([*PHOTOS, '/p/wells/measured'])


def test_states_and_setpoints_replace_missing_photographs_and_measurements(tmp_path: Path) -> None:
    bag = write_string_bag(tmp_path / 'run', [*STATES, *OTHERS])
    assert sorted(played_topics(bag, 'inputs')) == sorted([*STATES, '/p/wells/setpoint'])


def test_everything_but_the_clock_can_be_played(tmp_path: Path) -> None:
    bag = write_string_bag(tmp_path / 'run', [*STATES, *OTHERS])
    assert sorted(played_topics(bag, 'all')) == sorted([*STATES, *OTHERS[1:]])


def test_topics_are_named_absolute_or_relative(tmp_path: Path) -> None:
    bag = write_string_bag(tmp_path / 'run', [*STATES, *OTHERS])
    assert played_topics(bag, 'asset/new_state /p/rig/description') == [
        '/p/asset/new_state',
        '/p/rig/description',
    ]
    with pytest.raises(InputError, match="has no topic 'state'; it holds /p/asset/clean_state"):
        played_topics(bag, 'state')


def test_a_bag_without_inputs_is_refused(tmp_path: Path) -> None:
    bag = write_string_bag(tmp_path / 'run', ['/chatter'])
    with pytest.raises(InputError, match='no photographs or states to play'):
        played_topics(bag, 'inputs')


def test_latched_messages_from_before_the_start_come_first(tmp_path: Path) -> None:
    bag = write_string_bag(tmp_path / 'run', ['/a', '/b'], latched=('/a',))
    before = list(latched_before(bag, ['/a', '/b'], 4 * SECOND))
    assert [(message.topic, message.data) for message in before] == [
        ('/a', b'%d' % number) for number in range(4)
    ]


def test_setpoints_become_rates_that_hold_from_their_stamp_on(tmp_path: Path) -> None:
    serializer = Serializer()
    setpoint = Setpoint(sequence=3)
    setpoint.header.stamp.sec = 7
    setpoint.wells = rates_to_msg({'in': WellRate(1e-7, 1.0), 'out': WellRate(-1e-7)})
    with BagWriter(tmp_path / 'run') as writer:
        writer.add_topic('/p/wells/setpoint', 'porotwin_msgs/msg/Setpoint')
        writer.write('/p/wells/setpoint', serializer.to_cdr(setpoint), log_time=1)
    bag = BagReader(tmp_path / 'run')
    (message,) = bag.messages()
    rates = deserialize_message(as_measured(bag, message, serializer), WellRates)
    assert rates.start == rates.header.stamp == setpoint.header.stamp
    assert rates_from_msg(rates.wells) == rates_from_msg(setpoint.wells)
    again = deserialize_message(as_measured(bag, message, serializer, at=9 * SECOND), WellRates)
    assert again.start.sec == again.header.stamp.sec == 9


def test_measured_rates_keep_their_times(tmp_path: Path) -> None:
    serializer, measured = Serializer(), WellRates(wells=rates_to_msg({'in': WellRate(1e-7, 1.0)}))
    measured.start.sec, measured.header.stamp.sec = 5, 7
    with BagWriter(tmp_path / 'run') as writer:
        writer.add_topic('/p/wells/measured', 'porotwin_msgs/msg/WellRates')
        writer.write('/p/wells/measured', serializer.to_cdr(measured), log_time=1)
    bag = BagReader(tmp_path / 'run')
    (message,) = bag.messages()
    assert deserialize_message(as_measured(bag, message, serializer), WellRates) == measured
