"""The quality of service of every kind of topic, for publishers and subscribers."""

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from porotwin_core.ros.senders import LEASE_S


def _profile(depth: int, durability: DurabilityPolicy) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )


PHOTO = _profile(8, DurabilityPolicy.VOLATILE)
"""Photographs: none may be lost; a late subscriber gets none again."""

BASELINE = _profile(8, DurabilityPolicy.TRANSIENT_LOCAL)
"""Photographs without tracer: a late subscriber gets them all."""

FIELD = _profile(64, DurabilityPolicy.VOLATILE)
"""Maps, reports and events of the state sequence: deep enough that a burst loses none."""

CONFIG = _profile(1, DurabilityPolicy.TRANSIENT_LOCAL)
"""Constants of a running graph, such as the description of the rig: late subscribers get them."""

DECISIONS = _profile(64, DurabilityPolicy.TRANSIENT_LOCAL)
"""Follows a topic of CONFIG where every message counts: a replay sends many of them at once."""

CLOCK = _profile(1000, DurabilityPolicy.VOLATILE)
"""The time of a replay, where no step back may be missed."""

VOUCHED = _profile(PHOTO.depth, DurabilityPolicy.TRANSIENT_LOCAL)
"""Words about requests: requests in a row all count; who listens only now hears no old ones."""
VOUCHED.lifespan = Duration(nanoseconds=round(LEASE_S * 1e9))

SETPOINT = _profile(1, DurabilityPolicy.VOLATILE)
"""Setpoints: only the newest counts, and a late subscriber never gets an old one."""
