"""What must not be read as one recording, although it lies in one folder."""

import zlib
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_core.ros.from_messages import rig_from_msg
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_folder import bag_of
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.serialization import stamp_of

RIG_MARKS = ('name', 'width_m', 'height_m', 'wells')
"""Keys that tell one rig from another. Others may be corrected between two bags of one rig."""


def refuse_two_rigs(bag: BagReader) -> None:
    """Check that all bags in a folder are of one rig.

    Raises:
        InputError: they are not; the line names two bags and their rigs.
    """
    topics = [name for name in bag.topics if name.endswith(f'/{topic_names.RIG}')]
    rigs: dict[Path, tuple[Path, Rig]] = {}
    for file, messages in bag.messages_by_file(topics):
        for message in messages:
            with suppress(InputError):  # who reads the rig tells that it is not readable
                rigs[bag_of(file)] = file, rig_from_msg(bag.decode(message))
    found = list(rigs.values())
    for file, rig in found[1:]:
        first, own = found[0]
        keys = [key for key in RIG_MARKS if getattr(rig, key) != getattr(own, key)]
        if keys:
            one, other = _shown(bag, first), _shown(bag, file)
            raise InputError(
                f"{bag.path}: holds bags of two rigs, {one} of '{own.name}' and {other} of "
                f"'{rig.name}', which differ in {', '.join(keys)}; read {one} or {other} alone, or "
                'name the rig.yaml of both with --rig if it is one rig'
            )


def refuse_two_experiments(
    bag: BagReader, topics: Collection[str], heads: Mapping[str, int]
) -> None:
    """Check that messages of one time in several bags are copies of each other.

    A recorder that is started again never has the same time of recording again, in nanoseconds.
    Experiment folders that become bags count from the same date.

    Args:
        bag: the bags of a folder.
        topics: absolute names; their messages begin with a stamp.
        heads: number of first bytes to compare, by topic; all bytes of other topics.

    Raises:
        InputError: two bags differ; the line names them.
    """
    seen: dict[tuple[str, int, int], tuple[Path, set[int]]] = {}
    for file, messages in bag.messages_by_file(topics, heads):
        own: dict[tuple[str, int, int], set[int]] = {}
        for message in messages:
            with suppress(InputError):  # who reads the message tells that it is damaged
                key = message.topic, message.log_time, stamp_of(message.data)
                content = zlib.crc32(message.data[: heads.get(message.topic)])
                own.setdefault(key, set()).add(content)
        for key, contents in own.items():
            first, known = seen.setdefault(key, (file, contents))
            if bag_of(first) != bag_of(file) and known.isdisjoint(contents):
                one, other = _shown(bag, first), _shown(bag, file)
                raise InputError(
                    f"{bag.path}: {one} and {other} have the same times, but differ in '{key[0]}': "
                    'they hold two experiments, or two versions of one; read '
                    f'{one} or {other} alone'
                )


def _shown(bag: BagReader, file: Path) -> Path:
    """Return the folder of a bag in a folder of bags, or else its file."""
    return file if file.parent == bag.path else file.parent
