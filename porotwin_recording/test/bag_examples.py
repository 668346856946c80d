"""Bags of setpoints and words that the tests of readers and writers share."""

from pathlib import Path

from recording_examples import STRING
from std_msgs.msg import String

from porotwin_msgs.msg import Setpoint, WellRate
from porotwin_recording.mcap.bag_records import BagMessage, TopicQos
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.serialization import SECOND, Serializer

SETPOINT = 'porotwin_msgs/msg/Setpoint'


def setpoint(number: int) -> Setpoint:
    """Return a setpoint that differs with `number`, with a reason that is not ASCII."""
    wells = [WellRate(well='injector', rate=1.4e-7 / (number + 1), concentration=1.0)]
    message = Setpoint(sequence=number, wells=wells, reason=f'cycle {number}: plume, Größe')
    message.header.stamp.sec = number
    return message


def write_setpoints(path: Path, count: int = 20, *, compress: bool = True) -> list[BagMessage]:
    """Write `count` setpoints and as many words in turn; return the messages of the bag."""
    serializer = Serializer()
    written = []
    with BagWriter(path, compress=compress) as bag:
        bag.add_topic('/porotwin/wells/setpoint', SETPOINT, qos=TopicQos(depth=1))
        bag.add_topic('/words', STRING, qos=TopicQos(durability='transient_local'))
        for number in range(count):
            for topic, kind, message in (
                ('/porotwin/wells/setpoint', SETPOINT, setpoint(number)),
                ('/words', STRING, String(data='wort ' * number)),
            ):
                data = serializer.to_cdr(message)
                log_time = (100 + number) * SECOND
                bag.write(
                    topic, data, log_time=log_time, publish_time=log_time - 7, sequence=number
                )
                written.append(BagMessage(topic, kind, log_time, log_time - 7, number, data))
    return written
