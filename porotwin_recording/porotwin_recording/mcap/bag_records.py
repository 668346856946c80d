"""Records of a bag: topics with their quality of service, and messages."""

from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any, Literal

import yaml

from porotwin_core.rig.yaml_reader import read_yaml

History = Literal['keep_last', 'keep_all']
Reliability = Literal['reliable', 'best_effort']
Durability = Literal['volatile', 'transient_local']

# Bags from before ROS 2 Jazzy hold the numbers of the enumerations of rmw.
_HISTORY: dict[Any, History] = {1: 'keep_last', 2: 'keep_all'}
_RELIABILITY: dict[Any, Reliability] = {1: 'reliable', 2: 'best_effort'}
_DURABILITY: dict[Any, Durability] = {1: 'transient_local', 2: 'volatile'}

_FOREVER = {'sec': 9223372036, 'nsec': 854775807}
"""The longest duration of rmw, 2^63 - 1 ns."""


@dataclass(frozen=True)
class TopicQos:
    """The policies of a quality of service that decide which messages a subscriber receives."""

    history: History = 'keep_last'
    depth: int = 8
    reliability: Reliability = 'reliable'
    durability: Durability = 'volatile'

    @property
    def latched(self) -> bool:
        """Whether a late subscriber receives the last messages."""
        return self.durability == 'transient_local'


@dataclass(frozen=True)
class Topic:
    """A topic of a bag.

    Attributes:
        name: absolute name.
        type_name: message type as pkg/msg/Name.
        qos: quality of service of the publisher.
        definition: message definition in the format ros2msg; empty if the bag has none.
        message_count: number of messages in the bag.
        program: name and version of the program that made the messages; empty: not known; None:
            the bag does not say.
        pauses: of fixed wells as text (`rig_pauses`), beside a rig's description of version 0.2.
    """

    name: str
    type_name: str
    qos: TopicQos
    definition: str
    message_count: int = 0
    program: str | None = None
    pauses: str = ''


@dataclass(frozen=True, slots=True)
class BagMessage:
    """One serialized message (CDR).

    Attributes:
        topic: absolute name.
        type_name: message type as pkg/msg/Name.
        log_time: when it was received, on the recorder's clock [ns].
        publish_time: when it was published, on the publisher's computer [ns].
        sequence: the publisher's count of its messages; 0 if unknown.
        data: the message.
    """

    topic: str
    type_name: str
    log_time: int
    publish_time: int
    sequence: int
    data: bytes


def qos_profiles(qos: TopicQos) -> list[dict[str, Any]]:
    """Return `offered_qos_profiles` in the form of rosbag2's metadata since version 9."""
    return [
        {
            **asdict(qos),
            'deadline': dict(_FOREVER),
            'lifespan': dict(_FOREVER),
            'liveliness': 'automatic',
            'liveliness_lease_duration': dict(_FOREVER),
            'avoid_ros_namespace_conventions': False,
        }
    ]


@lru_cache(maxsize=128)
def qos_from_yaml(text: str) -> TopicQos:
    """Return the first profile in a text of `offered_qos_profiles`, or the default profile."""
    try:
        profiles = read_yaml(text)
    except (yaml.YAMLError, ValueError, RecursionError):
        profiles = None
    if not (isinstance(profiles, list) and profiles and isinstance(profiles[0], dict)):
        return TopicQos()
    first = profiles[0]
    default = TopicQos()

    def word(key: str, names: dict[Any, Any], fallback: Any) -> Any:
        value = first.get(key)
        if not isinstance(value, str | int):
            return fallback
        return value if value in names.values() else names.get(value, fallback)

    depth = first.get('depth')
    return TopicQos(
        word('history', _HISTORY, default.history),
        depth if isinstance(depth, int) and depth > 0 else default.depth,
        word('reliability', _RELIABILITY, default.reliability),
        word('durability', _DURABILITY, default.durability),
    )
