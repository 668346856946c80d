"""Qualities of service by what is carried; used on both ends of every topic."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def _profile(depth: int, durability: DurabilityPolicy) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )


PHOTO = _profile(8, DurabilityPolicy.VOLATILE)
"""Photographs: each is precious, none is repeated."""

BASELINE = _profile(8, DurabilityPolicy.TRANSIENT_LOCAL)
"""Photographs without tracer: a node that starts late needs them all."""

FIELD = _profile(64, DurabilityPolicy.VOLATILE)
"""Maps, reports and events of the state sequence: deep enough that a burst loses none."""

CONFIG = _profile(1, DurabilityPolicy.TRANSIENT_LOCAL)
"""What does not change while the graph runs, such as the rig's description."""

SETPOINT = _profile(1, DurabilityPolicy.VOLATILE)
"""Setpoints: only the newest counts, and a late joiner never receives an old one."""
