"""Selects the messages of a bag for a replay."""

from collections.abc import Collection, Iterator

from std_msgs.msg import Header

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.conversions import (
    nanoseconds_from_msg,
    rates_from_msg,
    rates_to_msg,
    stamp_to_msg,
)
from porotwin_msgs.msg import WellRates
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import BagMessage
from porotwin_recording.mcap.serialization import Serializer

LATCHED_LIMIT = 64
"""Number of messages of a latched topic that a late subscriber receives."""

CLOCK = '/clock'


def played_topics(bag: BagReader, selection: str) -> list[str]:
    """Return the absolute names of the topics of `bag` to play.

    Topics without messages are left out, and so is /clock, which follows from the log times.

    Args:
        bag: the bag.
        selection: `inputs`, `all`, or names separated by spaces, absolute or relative to the
            namespace. `inputs` are the data from the physical asset, from which the twin computes
            the rest: photographs, or states if there are none; measured rates, or setpoints if
            there are none (see `as_measured`); effects that were set in the model.

    Raises:
        InputError: a selected topic is not in the bag, or the bag holds no inputs.
    """
    filled = [name for name, topic in bag.topics.items() if topic.message_count and name != CLOCK]
    if selection == 'all':
        return filled
    if selection == 'inputs':
        return _inputs(bag, filled)
    chosen = []
    for word in selection.split():
        found = _ending(filled, [word.lstrip('/')])
        if not found:
            raise InputError(
                f"{bag.path}: has no topic '{word}'; it holds {', '.join(sorted(filled))}"
            )
        chosen += found
    return chosen


def _inputs(bag: BagReader, filled: list[str]) -> list[str]:
    if _ending(filled, [topic_names.IMAGE]):
        observations = [topic_names.IMAGE, topic_names.BASELINE]
    else:
        observations = [
            topic_names.NEW_STATE,
            topic_names.STATE_REFRESHED,
            topic_names.CLEAN_STATE,
        ]
    observed = _ending(filled, observations)
    if not observed:
        raise InputError(f'{bag.path}: holds no photographs or states to play; name --topics')
    rates = _ending(filled, [topic_names.MEASURED]) or _ending(filled, [topic_names.SETPOINT])
    decisions = _ending(filled, [topic_names.EFFECTS, topic_names.OFFER])
    return [*observed, *rates, *decisions]


def _ending(names: list[str], ends: list[str]) -> list[str]:
    return [name for name in names if any(f'/{name}'.endswith(f'/{end}') for end in ends)]


def as_measured(
    bag: BagReader, message: BagMessage, serializer: Serializer, *, at: int | None = None
) -> bytes:
    """Return a recorded setpoint as measured rates (CDR), as if the pumps had followed it exactly.

    The rates begin `at` [ns], or at the time of the setpoint. Measured rates keep their times; they
    get the installed version of their message.

    Raises:
        InputError: the message has no rates, or they are not valid.
    """
    told = bag.decode(message)
    stamp = nanoseconds_from_msg(told.header.stamp) if at is None else at
    start = nanoseconds_from_msg(told.start) if hasattr(told, 'start') else stamp
    return serializer.to_cdr(
        WellRates(
            header=Header(stamp=stamp_to_msg(stamp), frame_id=told.header.frame_id),
            start=stamp_to_msg(start),
            wells=rates_to_msg(rates_from_msg(told.wells)),
        )
    )


def latched_before(bag: BagReader, names: Collection[str], start: int) -> Iterator[BagMessage]:
    """Yield the last messages of latched topics before `start` [ns], ordered by log time.

    A node that joins a live run in its middle receives them. A node that joins a replay needs them
    as well.

    Raises:
        InputError: a chunk of the file is damaged.
    """
    latched = [name for name in names if bag.topics[name].qos.latched]
    kept: dict[str, list[BagMessage]] = {}
    if latched:
        for message in bag.messages(latched, stop=start):
            last = kept.setdefault(message.topic, [])
            last.append(message)
            del last[:-LATCHED_LIMIT]
    yield from sorted(
        (message for messages in kept.values() for message in messages),
        key=lambda message: message.log_time,
    )
