"""What must not be read as one recording, although it lies in one folder."""

from contextlib import suppress
from pathlib import Path

from porotwin_core.errors import InputError
from porotwin_core.from_messages import rig_from_msg
from porotwin_core.rig import Rig
from porotwin_recording import topic_names
from porotwin_recording.bag_folder import bag_of
from porotwin_recording.bag_reader import BagReader

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


def _shown(bag: BagReader, file: Path) -> Path:
    """Return the folder of a bag in a folder of bags, or else its file."""
    return file if file.parent == bag.path else file.parent
