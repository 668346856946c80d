"""Maps and rates for foreign viewers, read back from a bag by readers that know nothing of ours."""

from pathlib import Path

import numpy as np
import pytest
from patience import until

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from mcap.reader import make_reader  # noqa: E402
from mcap_ros2.decoder import DecoderFactory  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rosbags.highlevel import AnyReader  # noqa: E402

from porotwin_core.basis.units import from_ml_h  # noqa: E402
from porotwin_core.geometry.grid import Grid  # noqa: E402
from porotwin_core.rates.wells import WellRate  # noqa: E402
from porotwin_core.ros import conversions  # noqa: E402
from porotwin_core.ros.node_thread import NodeThread  # noqa: E402
from porotwin_core.ros.senders import SENDERS  # noqa: E402
from porotwin_msgs.msg import CycleReport, NewState, Setpoint, TracerField  # noqa: E402
from porotwin_page.display_node import DisplayNode, topic_part  # noqa: E402
from porotwin_page.map_pictures import colour_table  # noqa: E402
from porotwin_recording.mcap.bag_reader import BagReader  # noqa: E402
from porotwin_recording.recorder_node import RecorderNode  # noqa: E402

pytestmark = pytest.mark.graph

GRID = Grid(nx=4, nz=3, width=0.4, height=0.3)
VALUES = np.array([[0.0, 1.0, 0.25, 0.5], [0.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 0.75]])


def recorded(domain: int, bag: Path) -> None:
    """Record what the node makes of one cycle of the twin, which this test plays."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    overrides = [Parameter('output', value=str(bag))]
    recorder = RecorderNode(context=context, parameter_overrides=overrides)
    display = DisplayNode(context=context)
    kinds = {'asset/new_state': NewState, 'tracer/predicted': TracerField,
             'wells/setpoint': Setpoint, 'hub/cycle': CycleReport}  # fmt: skip
    nodes = {name: rclpy.create_node(SENDERS[name][0], context=context) for name in kinds}
    publishers = {name: nodes[name].create_publisher(kind, name, 8) for name, kind in kinds.items()}
    thread = NodeThread(recorder, display, *nodes.values(), threads=4)
    try:
        until(lambda: all(one.get_subscription_count() == 2 for one in publishers.values()))
        header = conversions.header_at(30.0)
        tracer = conversions.tracer_to_msg(VALUES, GRID, 30.0)
        rates = {'Zufluss 2/ä': WellRate(from_ml_h(200.0)), 'zu': WellRate()}
        wells = conversions.rates_to_msg(rates)
        publishers['asset/new_state'].publish(NewState(header=header, tracer=tracer))
        publishers['tracer/predicted'].publish(tracer)
        publishers['wells/setpoint'].publish(Setpoint(header=header, wells=wells))
        publishers['hub/cycle'].publish(
            CycleReport(prediction_error=0.25, corrected_error=np.nan, disallowed_tracer=2e-6)
        )
        until(lambda: len(display._made) == 11)
        topics = [f'display/{name}' for name in display._made]
        until(lambda: all(display.count_subscribers(topic) == 1 for topic in topics))
        sent = {f'/{topic}' for topic in topics if 'corrected' not in topic}
        until(lambda: sent <= {one.topic for one in BagReader(bag).messages()})
    finally:
        thread.end()


def test_other_readers_see_maps_and_numbers_in_a_bag(domain: int, tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    recorded(domain, bag)
    with AnyReader([bag]) as reader:
        rosbags = {
            connection.topic: reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
        }
    with next(bag.glob('*.mcap')).open('rb') as file:
        decoded = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        mcap = {channel.topic: message for _, channel, _, message in decoded}
    for found in (rosbags, mcap):
        image = found['/display/observed']
        assert (image.encoding, image.height, image.width, image.step) == ('32FC1', 3, 4, 16)
        assert (image.header.frame_id, image.header.stamp.sec) == ('rig', 30)
        pixels = np.frombuffer(bytes(image.data), '<f4').reshape(3, 4)
        np.testing.assert_array_equal(pixels[::-1], VALUES.astype(np.float32))
        picture = found['/display/predicted_coloured']
        assert (picture.encoding, picture.step) == ('bgr8', 12)
        colours = np.frombuffer(bytes(picture.data), np.uint8).reshape(3, 4, 3)
        full = colour_table('concentration', 'light')[-1, :3]
        np.testing.assert_array_equal(colours[2, 1], full)
        np.testing.assert_array_equal(colours[0, 0], [128, 128, 128])
        assert found['/display/setpoint_ml_h/Zufluss_2'].data == pytest.approx(200.0)
        assert found['/display/prediction_error'].data == 0.25
        assert found['/display/disallowed_tracer_ml'].data == pytest.approx(2.0)
        assert '/display/corrected_error' not in found


def test_every_name_of_a_well_becomes_a_name_of_a_topic() -> None:
    names = ['control1', 'well 2', '2', 'ü', '__a__b', 'a/b~c']
    assert [topic_part(name) for name in names] == [
        'control1', 'well_2', 'well_2', 'well', 'a_b', 'a_b_c',
    ]  # fmt: skip
