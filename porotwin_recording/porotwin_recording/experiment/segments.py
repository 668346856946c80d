"""The experiments in a bag: where one begins anew, and where it only goes on after a restart."""

from dataclasses import dataclass, field
from typing import NamedTuple

from porotwin_core.basis.photo_list import Role
from porotwin_core.clock.photo_interval import LONGEST_GAP_S
from porotwin_core.clock.stamps import SINCE_1970
from porotwin_core.rates.wells import WellRates
from porotwin_recording.mcap.serialization import SECOND

SINCE_1970_NS = int(SINCE_1970) * SECOND
"""Stamps from here on [ns] count from 1970: one stamp is one moment.

Smaller stamps count from the start of an experiment, and the next experiment has them again.
"""

_SAME_SHARE = 0.5
"""Share of repeated stamps above which photographs were sent again; another experiment has none."""


class Location(NamedTuple):
    """Location of a message in a bag.

    `number` counts the messages of the topic with the same log time [ns].
    """

    topic: str
    log_time: int
    number: int


class PhotoKey(NamedTuple):
    """Identity of a photograph: the same one may be recorded again after a restart.

    `checksum` is the CRC-32 of the file: two photographs may have one stamp [ns].
    """

    role: Role
    stamp: int
    checksum: int


@dataclass(frozen=True)
class LocatedPhoto:
    """A photograph in a bag, and the suffix of its file."""

    location: Location
    suffix: str


class ToldRates(NamedTuple):
    """Rates in a message [m^3/s], from `start` to `end` [ns]: a setpoint, or measured ones."""

    start: int
    end: int
    rates: WellRates
    is_order: bool


@dataclass
class Segment:
    """The data of one experiment in a bag, by stamp [ns].

    Attributes:
        start: stamp of the message that starts it; None without such a message.
        told: setpoints and measured rates, in the order of their arrival.
        maps: tracer maps.
        photos: photographs.
        interruptions: stamps at which the sequence of states began again.
    """

    start: int | None = None
    told: list[ToldRates] = field(default_factory=list)
    maps: dict[int, Location] = field(default_factory=dict)
    photos: dict[PhotoKey, LocatedPhoto] = field(default_factory=dict)
    interruptions: list[int] = field(default_factory=list)
    _newest: tuple[int, Location | None] | None = None

    @property
    def state_count(self) -> int:
        """Number of states: maps, or photographs where there are no maps."""
        return len(self.maps) or sum(key.role == 'state' for key in self.photos)

    def start_stamp(self) -> int:
        """Return the start of the experiment [ns]: its CleanState message or the first stamp."""
        if self.start is not None:
            return self.start
        states = (key.stamp for key in self.photos if key.role == 'state')
        return min((*(one.start for one in self.told), *self.maps, *states), default=0)

    def restarted(self, stamp: int, *, starts: bool) -> list['Segment']:
        """Take note of a CleanState message; return the new experiment that begins with it, if any.

        Another experiment begins where the time goes back, or where a sequence starts after a new
        baseline, or after more than a week, with the old baseline: the camera's clock was wrong
        before. A sequence that starts at another later time goes on with this experiment.

        Args:
            stamp: stamp of the message [ns].
            starts: whether its cause is START.
        """
        first = self._take_back(stamp)
        if not self.maps:
            if starts and self.start is None:
                self.start = stamp
            self.maps.update(first)
            return []
        last = max(self.maps)
        baselines = [key for key in self.photos if key.role == 'baseline' and key.stamp > last]
        long_after = stamp - last > LONGEST_GAP_S * SECOND
        if stamp > last and not (starts and (baselines or long_after)):
            self.interruptions.append(stamp)
            self.maps.update(first)
            return []
        # the photograph of the first state and the new baselines come before the message
        states = [key for key in self.photos if key.stamp == stamp > last and key not in baselines]
        photos = {key: self.photos.pop(key) for key in (*baselines, *states)}
        if long_after and not baselines:
            photos |= {key: one for key, one in self.photos.items() if key.role == 'baseline'}
        return [Segment(stamp, maps=first, photos=photos)]

    def add_map(self, stamp: int, location: Location) -> None:
        """Add the map with `stamp` [ns]; it replaces one with the same stamp."""
        self._newest = stamp, self.maps.get(stamp)
        self.maps[stamp] = location

    def _take_back(self, stamp: int) -> dict[int, Location]:
        """Remove and return the newest map if it has this `stamp`.

        Topics keep no order between them: it may have come before the message of its start.
        """
        if self._newest is None or self._newest[0] != stamp or stamp not in self.maps:
            return {}
        newest = {stamp: self.maps.pop(stamp)}
        if (replaced := self._newest[1]) is not None:
            self.maps[stamp] = replaced
        self._newest = None
        return newest


def joined(segments: list[Segment]) -> list[Segment]:
    """Return the experiments in `segments`; photographs that were sent again are one experiment.

    A camera that is restarted may send its folder again, with the same stamps since 1970.
    """
    found = segments[:1]
    for segment in segments[1:]:
        if _sent_again(found[-1], segment):
            _append(found[-1], segment)
        else:
            found.append(segment)
    return found


def _sent_again(earlier: Segment, later: Segment) -> bool:
    if not later.maps:
        return True
    if min(*earlier.maps, *later.maps) < SINCE_1970_NS:
        return False
    overlap = [stamp for stamp in later.maps if stamp <= max(earlier.maps)]
    shared = later.maps.keys() & earlier.maps.keys()
    return len(shared) > _SAME_SHARE * len(overlap)


def _append(earlier: Segment, later: Segment) -> None:
    earlier.told += later.told
    earlier.maps.update(later.maps)
    earlier.photos.update(later.photos)
    assert later.start is not None
    earlier.interruptions += [later.start, *later.interruptions]
