"""What of a bag is played, and when: selection of topics, latched messages, pace."""

import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from porotwin_core.conversions import rates_from_msg, rates_to_msg
from porotwin_core.errors import InputError
from porotwin_msgs.msg import WellRates
from porotwin_recording import topics
from porotwin_recording.bag_reader import BagMessage, BagReader
from porotwin_recording.serialization import SECOND, Serializer

LATCHED_LIMIT = 64
"""Messages of a latched topic that a late subscriber still gets."""

CLOCK = '/clock'


def played_topics(bag: BagReader, wanted: str) -> list[str]:
    """Return the topics of `bag` to play.

    `inputs` are what the physical asset told the twin: rates, and the photographs or, where there
    are none, the states; the twin computes the rest again. Without measured rates the setpoints
    stand for them, see `as_measured`. `all` is everything recorded, for looking at it. Else names
    separated by spaces, absolute or as in the namespace.
    /clock is never among them: it comes from the log times.

    Raises:
        InputError: a named topic is not in the bag, or there are no inputs in it.
    """
    filled = [name for name, topic in bag.topics.items() if topic.message_count and name != CLOCK]
    if wanted == 'all':
        return filled
    if wanted == 'inputs':
        photographs = _ending(filled, [topics.IMAGE])
        states = [topics.NEW_STATE, topics.STATE_REFRESHED, topics.CLEAN_STATE]
        seen = [topics.IMAGE, topics.BASELINE] if photographs else states
        states_or_photographs = _ending(filled, seen)
        if not states_or_photographs:
            raise InputError(f'{bag.path}: holds no photographs or states to play; name --topics')
        rates = _ending(filled, [topics.MEASURED]) or _ending(filled, [topics.SETPOINT])
        return [*states_or_photographs, *rates]
    chosen = []
    for word in wanted.split():
        found = _ending(filled, [word.lstrip('/')])
        if not found:
            raise InputError(
                f"{bag.path}: has no topic '{word}'; it holds {', '.join(sorted(filled))}"
            )
        chosen += found
    return chosen


def _ending(names: list[str], ends: list[str]) -> list[str]:
    return [name for name in names if any(f'/{name}'.endswith(f'/{end}') for end in ends)]


def as_measured(bag: BagReader, message: BagMessage, serializer: Serializer) -> bytes:
    """Return a recorded setpoint as the measured rates (CDR) of pumps that do as they are told."""
    setpoint = bag.decode(message)
    stamp = Time(sec=int(setpoint.header.stamp.sec), nanosec=int(setpoint.header.stamp.nanosec))
    return serializer.to_cdr(
        WellRates(
            header=Header(stamp=stamp, frame_id=setpoint.header.frame_id),
            start=stamp,
            wells=rates_to_msg(rates_from_msg(setpoint.wells)),
        )
    )


def latched_before(bag: BagReader, names: Collection[str], start: int) -> Iterator[BagMessage]:
    """Yield the last messages of latched topics from before `start` [ns], the oldest first.

    A node that joins in the middle of a run has these, so one that joins a replay gets them too.
    """
    latched = [name for name in names if bag.topics[name].qos.latched]
    kept: dict[str, list[BagMessage]] = {}
    if latched:
        for message in bag.messages(latched, stop=start):
            waiting = kept.setdefault(message.topic, [])
            waiting.append(message)
            del waiting[:-LATCHED_LIMIT]
    yield from sorted(
        (message for messages in kept.values() for message in messages),
        key=lambda message: message.log_time,
    )


@dataclass
class Pace:
    """Bag time against wall time: `rate` times as fast, or without waiting when `rate` is 0."""

    rate: float
    _bag_origin: int = 0
    _wall_origin: float = field(default_factory=time.monotonic)

    def begin(self, log_time: int) -> None:
        """Let `log_time` [ns] be now."""
        self._bag_origin = log_time
        self._wall_origin = time.monotonic()

    def wait_for(self, log_time: int) -> float:
        """Return how long to wait until `log_time` [ns] is due [s]."""
        if self.rate <= 0:
            return 0.0
        elapsed = (log_time - self._bag_origin) / SECOND / self.rate
        return max(0.0, self._wall_origin + elapsed - time.monotonic())

    def now(self) -> int:
        """Return the bag time of this moment [ns]."""
        elapsed = time.monotonic() - self._wall_origin
        return self._bag_origin + int(elapsed * max(self.rate, 0.0) * SECOND)
