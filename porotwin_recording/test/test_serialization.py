"""Tests of the serialization: our bytes are ROS's, and messages of old bags are completed."""

import random
import tracemalloc
from typing import Any

import numpy as np
import pytest
from bag_examples import SETPOINT, setpoint
from rclpy.serialization import deserialize_message

from porotwin_core.basis.errors import InputError
from porotwin_msgs.msg import Setpoint
from porotwin_recording.mcap.definitions import (
    message_definition,
    new_typestore,
    register_definition,
)
from porotwin_recording.mcap.serialization import SECOND, Deserializer, Serializer, stamp_of

CAMERA = 'porotwin_msgs/msg/CameraGeometry'
RATES = 'porotwin_msgs/msg/WellRates'


def without(definition: str, *fields: str) -> str:
    """Return a definition without the lines that begin with `fields`."""
    lines = definition.splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith(fields)]
    assert len(kept) == len(lines) - len(fields)
    return ''.join(kept)


def read_old(type_name: str, definition: str, data: bytes) -> Any:
    return Deserializer(type_name, definition).from_cdr(data)


def old_store(type_name: str, definition: str) -> Any:
    store = new_typestore()
    register_definition(store, type_name, definition)
    return store


def test_our_bytes_are_those_of_rclpy() -> None:
    message = setpoint(3)
    assert deserialize_message(Serializer().to_cdr(message), Setpoint) == message


def test_a_message_of_the_installed_definition_comes_back() -> None:
    message = read_old(SETPOINT, message_definition(SETPOINT), Serializer().to_cdr(setpoint(3)))
    assert message.sequence == 3
    assert message.reason == setpoint(3).reason
    assert message.wells[0].well == 'injector'


def test_fields_that_an_old_definition_lacks_have_default_values() -> None:
    definition = 'uint64 sequence\n'
    store = old_store(SETPOINT, definition)
    data = bytes(store.serialize_cdr(store.types[SETPOINT](sequence=3), SETPOINT))
    message = read_old(SETPOINT, definition, data)
    assert message.sequence == 3
    assert message.reason == ''
    assert message.wells == []
    assert (message.valid_until.sec, message.header.frame_id) == (0, '')


def test_arrays_of_fixed_length_are_filled_with_zeros() -> None:
    definition = without(message_definition(CAMERA), 'float64[8] corners', 'float64[] colour')
    store = old_store(CAMERA, definition)
    values = {'curvature_names': ['k1'], 'curvature_values': np.array([0.5])}
    values |= {'references': np.zeros(0), 'reference_corners': np.zeros(0, np.uint32)}
    data = bytes(store.serialize_cdr(store.types[CAMERA](**values), CAMERA))
    message = read_old(CAMERA, definition, data)
    np.testing.assert_array_equal(message.corners, np.zeros(8))
    assert message.colour_checker.shape == (0,)
    assert list(message.curvature_names) == ['k1']


def test_nested_messages_are_completed() -> None:
    definition = without(message_definition(RATES), 'float64 concentration')
    definition = without(definition, 'float64 rise')
    store = old_store(RATES, definition)
    types = store.types
    time = types['builtin_interfaces/msg/Time'](sec=7, nanosec=0)
    rates = types[RATES](
        header=types['std_msgs/msg/Header'](stamp=time, frame_id='rig'),
        start=time,
        wells=[types['porotwin_msgs/msg/WellRate'](well='injector', rate=1e-7)],
    )
    message = read_old(RATES, definition, bytes(store.serialize_cdr(rates, RATES)))
    (well,) = message.wells
    assert (well.well, well.rate, well.concentration, well.rise) == ('injector', 1e-7, 0, 0)


def test_a_field_that_changed_its_type_stays_as_recorded() -> None:
    definition = 'string wells\n'
    store = old_store(RATES, definition)
    data = bytes(store.serialize_cdr(store.types[RATES](wells='injector'), RATES))
    assert read_old(RATES, definition, data).wells == 'injector'


def test_a_type_that_is_not_installed_stays_as_recorded() -> None:
    name, definition = 'nowhere_msgs/msg/Word', 'string text\n'
    store = old_store(name, definition)
    data = bytes(store.serialize_cdr(store.types[name](text='hello'), name))
    assert read_old(name, definition, data).text == 'hello'


def test_bytes_of_another_type_are_refused() -> None:
    with pytest.raises(InputError, match=f"message is not a '{SETPOINT}'"):
        read_old(SETPOINT, message_definition(SETPOINT), b'\x00\x01\x00\x00\x01\x00')


def test_the_stamp_is_read_without_the_rest() -> None:
    assert stamp_of(Serializer().to_cdr(setpoint(3))) == 3 * SECOND
    with pytest.raises(InputError, match='8 bytes has no stamp'):
        stamp_of(bytes(8))


@pytest.mark.parametrize('seed', range(20))
def test_random_bytes_are_named_in_one_line_without_much_memory(seed: int) -> None:
    generator = random.Random(seed)
    whole = bytearray(Serializer().to_cdr(setpoint(seed)))
    deserializer = Deserializer(SETPOINT, message_definition(SETPOINT))
    tracemalloc.start()
    for _ in range(50):
        damaged = bytearray(whole)
        for _ in range(generator.choice([1, 5, 40])):
            damaged[generator.randrange(4, len(damaged))] = generator.choice([0, 255, 128])
        try:
            deserializer.from_cdr(bytes(damaged[: generator.randrange(len(damaged))]))
        except InputError as error:
            assert '\n' not in str(error)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 32 << 20
