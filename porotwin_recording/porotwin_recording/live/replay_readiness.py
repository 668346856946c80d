"""Decides whether a running graph is ready for a replay: no message may find a closed door."""

from dataclasses import dataclass

from porotwin_recording.mcap import topic_names

TWIN = frozenset({'imaging', 'solver', 'costa', 'hub'})
"""Nodes that every photograph needs. If one of them runs, the others are starting."""

RECORDER = 'recorder'
"""The node that subscribes to a topic after it has found a publisher."""

HUB = 'hub'
"""The node that tells which rig the graph stands for, and where it takes its time from."""

SERVICES = frozenset({'solver/predict', 'costa/corrective_source'})
"""Services of the twin that the first photograph needs."""

CONSUMERS = {
    topic_names.IMAGE: 'imaging',
    topic_names.BASELINE: 'imaging',
    topic_names.MEASURED: 'hub',
    topic_names.SETPOINT: 'hub',  # played as a measurement, see `player.as_measured`
    topic_names.NEW_STATE: 'hub',
    topic_names.STATE_REFRESHED: 'hub',
    topic_names.CLEAN_STATE: 'hub',
}
"""Node of the twin that takes each input."""


@dataclass(frozen=True)
class PlayedTopic:
    """A topic to play, as the player sees its subscribers.

    Attributes:
        name: absolute name.
        connected: number of subscribers that are connected to the player.
        subscribers: names of the nodes that subscribe to it, connected or not.
    """

    name: str
    connected: int
    subscribers: tuple[str, ...]


@dataclass(frozen=True)
class GraphSeen:
    """The running graph as the player sees it.

    Attributes:
        nodes: names of all other nodes in the player's namespace.
        topics: the topics to play.
        services: names of all services in that namespace, relative to it.
        recorded: names of the topics that the node `recorder` takes; None: all.
        answering: whether somebody publishes the answers of the lock-step; None: no lock-step.
        simulated: whether the node `hub` takes its time from /clock; None: it has not told.
        deaf: pairs of nodes, sender and receiver, whose connection a lock-step needs and the sender
            has not yet told.
    """

    nodes: frozenset[str]
    topics: tuple[PlayedTopic, ...]
    services: frozenset[str] = frozenset()
    recorded: frozenset[str] | None = None
    answering: bool | None = None
    simulated: bool | None = True
    deaf: tuple[tuple[str, str], ...] = ()


def missing(seen: GraphSeen) -> list[str]:
    """Return what a replay has to wait for, one phrase each; empty: it may begin."""
    twin = TWIN & seen.nodes
    waits = [f'node {name}' for name in sorted(TWIN - twin)] if twin else []
    waits += [f'service {name}' for name in sorted(SERVICES - seen.services) if twin]
    for topic in seen.topics:
        wanted = {node for end, node in CONSUMERS.items() if topic.name.endswith(f'/{end}')}
        if not twin:
            wanted = set()
        takes_all = seen.recorded is None or topic.name in seen.recorded
        if RECORDER in seen.nodes and takes_all:
            wanted.add(RECORDER)
        late = sorted((wanted & seen.nodes) - set(topic.subscribers))
        waits += [f'{name} to subscribe to {topic.name}' for name in late]
        if topic.connected < len(topic.subscribers):
            known = len(topic.subscribers)
            of_all = '1 node' if known == 1 else f'{known} nodes'
            waits.append(f'{topic.name} to connect {known - topic.connected} of {of_all}')
    if not any(topic.connected for topic in seen.topics):
        waits.insert(0, 'a subscriber of any played topic')
    if HUB in seen.nodes and seen.simulated is None:
        waits.append('node hub to tell where it takes its time from')
    if twin:
        waits += [f'{receiver} to hear node {sender}' for sender, receiver in seen.deaf]
    if seen.answering is False:
        waits.insert(0, 'the node that answers in lock-step')
    return waits
