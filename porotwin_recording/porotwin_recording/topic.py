"""A topic as a bag keeps it: name, type, and the quality of service its publisher offered."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

import yaml

History = Literal['keep_last', 'keep_all']
Reliability = Literal['reliable', 'best_effort']
Durability = Literal['volatile', 'transient_local']

# Numbers of the enumerations of rmw, which bags before ROS 2 Jazzy hold instead of words.
_HISTORY: dict[Any, History] = {1: 'keep_last', 2: 'keep_all'}
_RELIABILITY: dict[Any, Reliability] = {1: 'reliable', 2: 'best_effort'}
_DURABILITY: dict[Any, Durability] = {1: 'transient_local', 2: 'volatile'}

_FOREVER = {'sec': 9223372036, 'nsec': 854775807}


@dataclass(frozen=True)
class TopicQos:
    """What of a quality of service decides who gets which message."""

    history: History = 'keep_last'
    depth: int = 8
    reliability: Reliability = 'reliable'
    durability: Durability = 'volatile'

    @property
    def latched(self) -> bool:
        """Whether a subscriber that comes late still gets the last messages."""
        return self.durability == 'transient_local'


@dataclass(frozen=True)
class Topic:
    """A topic in a bag; `definition` (ros2msg) is empty where the bag does not hold it."""

    name: str
    type_name: str
    qos: TopicQos
    definition: str
    message_count: int = 0


def qos_profiles(qos: TopicQos) -> list[dict[str, Any]]:
    """Return `offered_qos_profiles` as rosbag2 keeps it since version 9 of its metadata."""
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


def qos_from_yaml(text: str) -> TopicQos:
    """Return the first profile of `offered_qos_profiles`, or the default where there is none."""
    try:
        profiles = yaml.safe_load(text)
    except yaml.YAMLError:
        profiles = None
    if not (isinstance(profiles, list) and profiles and isinstance(profiles[0], dict)):
        return TopicQos()
    first = profiles[0]
    default = TopicQos()

    def word(key: str, names: dict[Any, Any], fallback: Any) -> Any:
        value = first.get(key)
        return value if value in names.values() else names.get(value, fallback)

    depth = first.get('depth')
    return TopicQos(
        word('history', _HISTORY, default.history),
        depth if isinstance(depth, int) and depth > 0 else default.depth,
        word('reliability', _RELIABILITY, default.reliability),
        word('durability', _DURABILITY, default.durability),
    )
