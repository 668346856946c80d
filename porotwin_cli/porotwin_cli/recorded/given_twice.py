"""Recordings that a person names twice, by their name or as a copy."""

from collections.abc import Sequence
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.report.origin import place_of
from porotwin_recording.experiment.recording import Recording


def refuse_twice(recordings: Sequence[Recording]) -> None:
    """Refuse a recording that is named twice, or a copy of it.

    It would count twice in a diagnosis, and judge a training that has learnt from it. Two
    recordings never share their last map to the last bit, because its noise differs.

    Raises:
        InputError: there is one.
    """
    places: set[Path] = set()
    last_maps: dict[bytes, Path] = {}
    for recording in recordings:
        place = place_of(recording.source)
        if place in places:
            raise InputError(f'{recording.source}: is named twice; name every recording once')
        places.add(place)
        last = recording.present_maps[-1].tobytes()
        other = last_maps.setdefault(last, recording.source)
        if other != recording.source:
            raise InputError(
                f'{recording.source}: is a copy of {other}, with the same last map; leave it out'
            )
