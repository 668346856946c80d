"""Tests of the decision whether a replay may begin, on descriptions of a graph."""

from porotwin_recording.live.replay_readiness import SERVICES, GraphSeen, PlayedTopic, missing

IMAGE = '/porotwin/camera/image/compressed'
MEASURED = '/porotwin/wells/measured'
TWIN = frozenset({'imaging', 'solver', 'costa', 'hub'})


def image(*subscribers: str, connected: int | None = None) -> PlayedTopic:
    count = len(subscribers) if connected is None else connected
    return PlayedTopic(IMAGE, count, subscribers)


def test_a_complete_twin_is_ready() -> None:
    assert missing(GraphSeen(TWIN, (image('imaging'),), SERVICES)) == []


def test_nobody_listens() -> None:
    assert missing(GraphSeen(frozenset(), (image(),))) == ['a subscriber of any played topic']


def test_a_stranger_alone_is_enough() -> None:
    topics = (image('foxglove'), PlayedTopic(MEASURED, 0, ()))
    assert missing(GraphSeen(frozenset(), topics)) == []


def test_a_twin_that_starts_is_waited_for_although_another_node_listens() -> None:
    seen = GraphSeen(TWIN - {'hub'}, (image('page'),), SERVICES)
    assert missing(seen) == ['node hub', f'imaging to subscribe to {IMAGE}']


def test_the_services_of_the_models_are_waited_for() -> None:
    seen = GraphSeen(TWIN, (image('imaging'),), frozenset({'solver/predict'}))
    assert missing(seen) == ['service costa/corrective_source']


def test_every_known_subscriber_must_be_connected() -> None:
    seen = GraphSeen(TWIN, (image('imaging', 'page', connected=1),), SERVICES)
    assert missing(seen) == [f'{IMAGE} to connect 1 of 2 nodes']
    seen = GraphSeen(TWIN, (image('imaging', connected=0),), SERVICES)
    assert f'{IMAGE} to connect 1 of 1 node' in missing(seen)


def test_the_recorder_is_waited_for_unless_it_takes_other_topics() -> None:
    nodes = frozenset({'recorder'})
    topics = (image('page'),)
    assert missing(GraphSeen(nodes, topics)) == [f'recorder to subscribe to {IMAGE}']
    assert missing(GraphSeen(nodes, topics, recorded=frozenset({MEASURED}))) == []


def test_lock_step_needs_the_answering_node() -> None:
    seen = GraphSeen(TWIN, (image('imaging'),), SERVICES, answering=False)
    assert missing(seen) == ['the node that answers in lock-step']


def test_the_hub_tells_its_time_before_anything_is_played() -> None:
    seen = GraphSeen(TWIN, (image('imaging'),), SERVICES, simulated=None)
    assert missing(seen) == ['node hub to tell where it takes its time from']
    assert missing(GraphSeen(frozenset(), (image('page'),), simulated=None)) == []


def test_lock_step_needs_connections_that_only_their_sender_can_tell() -> None:
    seen = GraphSeen(TWIN, (image('imaging'),), SERVICES, deaf=(('imaging', 'hub'),))
    assert missing(seen) == ['hub to hear node imaging']
