"""The camera node goes on whatever a look or a photograph raises."""

from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from porotwin_imaging.audience import Audience
from porotwin_imaging.camera_node import CameraNode
from porotwin_imaging.sources import Photo, Problem


def node(poll, publish, complaints: list[str]) -> SimpleNamespace:
    """What a look needs of the node, with one listener to its photographs."""
    return SimpleNamespace(
        _audience=Audience(1),
        _state=SimpleNamespace(get_subscription_count=lambda: 1, topic_name='photos'),
        count_subscribers=lambda _: 1,
        _source=SimpleNamespace(poll=poll),
        _publish=publish,
        _complain=lambda problem: complaints.append(problem.reason),
    )


def test_a_photograph_that_cannot_be_sent_is_named_and_the_others_go_on() -> None:
    photos = [Photo(b'', time, 'state', f'{time:g}.jpg') for time in (1.0, 2.0, 3.0)]
    sent, complaints = [], []

    def publish(photo: Photo) -> None:
        if photo.time == 2.0:
            raise AssertionError('not a stamp')
        sent.append(photo.name)

    problem = Problem('0.jpg', 'truncated')
    CameraNode._look(node(lambda: (photos, [problem]), publish, complaints))
    assert sent == ['1.jpg', '3.jpg']
    assert complaints[0] == 'truncated'
    assert complaints[1].startswith("photograph '2.jpg' cannot be sent: AssertionError")


def test_a_look_that_fails_is_told() -> None:
    def poll() -> None:
        raise RuntimeError('what nobody thought of')

    complaints: list[str] = []
    CameraNode._look(node(poll, None, complaints))
    assert complaints == ["looking for photographs failed: RuntimeError('what nobody thought of')"]
