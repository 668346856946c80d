"""The experiment in a bag: rig, rates, tracer maps and photographs from recorded messages."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.from_messages import rates_from_msg, rig_from_msg
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule, WellRates
from porotwin_recording import topic_names
from porotwin_recording.bag_reader import BagMessage, BagReader
from porotwin_recording.concentration import ConcentrationMaps, Maps
from porotwin_recording.photos import Photo, Role
from porotwin_recording.recorded_data import RecordedData
from porotwin_recording.serialization import SECOND, stamp_of

_START = 0
"""Value of CleanState.START; a bag is read without the installed message classes."""

_SUFFIXES = {b'\xff\xd8': '.jpg', b'\x89P': '.png', b'II': '.tif', b'MM': '.tif'}
"""Suffix of an image file by its first two bytes."""

_SIZE_TOLERANCE = 1e-6
"""Relative difference of sizes that only round-off explains."""


def read_bag(path: Path, rig: Rig | None = None) -> RecordedData:
    """Return the experiment in the bag at `path`; a given `rig` replaces the recorded one.

    - Time zero is the stamp of the CleanState message that starts the experiment, else the first
      stamp. Earlier rates hold from time zero on.
    - If two maps or rates have the same stamp, the later message counts.
    - A setpoint holds until the next one, regardless of its validity.
    - Reading ends where a second experiment starts at an earlier time.
    - Rates that are not finite or belong to unknown wells are left out, as in the hub.

    Raises:
        InputError: no bag, a damaged bag, a bag without a rig, or maps of another rig.
    """
    bag = BagReader(path)
    names = _experiment_topics(bag)
    collector = _Collector(bag)
    try:
        collector.collect(names)
    except AttributeError as error:
        raise InputError(
            f'{path}: recorded with other interfaces ({error}); read it with the version of '
            'PoroTwin that made it'
        ) from None
    if rig is None:
        rig = collector.rig
    if rig is None:
        raise InputError(f'{path}: {collector.rig_fault}; name its rig.yaml with --rig')
    collector.remove_unknown_wells(rig)
    start = collector.start_stamp()
    return RecordedData(
        rig,
        commanded=_schedule(collector.commanded, start),
        measured=_schedule(collector.measured, start),
        maps=_maps(collector, start, rig),
        photos=_photos(collector, start),
        remarks=tuple(bag.remarks),
    )


def _experiment_topics(bag: BagReader) -> dict[str, str]:
    """Return the topics of an experiment: absolute name to name in the namespace."""
    names: dict[str, str] = {}
    for relative in (
        topic_names.RIG,
        topic_names.SETPOINT,
        topic_names.MEASURED,
        topic_names.NEW_STATE,
        topic_names.CLEAN_STATE,
        topic_names.IMAGE,
        topic_names.BASELINE,
    ):
        matching = sorted(name for name in bag.topics if name.endswith(f'/{relative}'))
        if len(matching) > 1:
            raise InputError(
                f"{bag.path}: holds two rigs ('{matching[0]}', '{matching[1]}'); record one alone"
            )
        names.update(dict.fromkeys(matching, relative))
    if not names:
        raise InputError(f'{bag.path}: holds no topic of a PoroTwin experiment')
    return names


class _Location(NamedTuple):
    """Location of a message in a bag.

    `number` counts the messages of the topic with the same log time [ns].
    """

    topic: str
    log_time: int
    number: int


def _located(messages: Iterable[BagMessage]) -> Iterator[tuple[_Location, BagMessage]]:
    """Yield messages with their locations."""
    last: dict[str, _Location] = {}
    for message in messages:
        before = last.get(message.topic)
        repeated = before is not None and before.log_time == message.log_time
        number = before.number + 1 if before is not None and repeated else 0
        last[message.topic] = _Location(message.topic, message.log_time, number)
        yield last[message.topic], message


def _between(bag: BagReader, locations: list[_Location]) -> Iterator[tuple[_Location, BagMessage]]:
    """Yield the messages from the first to the last of `locations`, all of one topic."""
    if locations:
        log_times = [location.log_time for location in locations]
        topic, stop = locations[0].topic, max(log_times) + 1
        yield from _located(bag.messages([topic], start=min(log_times), stop=stop))


@dataclass(frozen=True)
class _LocatedPhoto:
    role: Role
    stamp: int
    location: _Location
    name: str


class _Collector:
    """Collects one experiment in one pass over a bag; maps and photographs stay on disk.

    Rates and the locations of maps are stored by stamp [ns].
    """

    def __init__(self, bag: BagReader) -> None:
        self.bag = bag
        self.rig: Rig | None = None
        self.rig_fault = 'holds no rig description'
        self.commanded: dict[int, WellRates] = {}
        self.measured: dict[int, WellRates] = {}
        self.maps: dict[int, _Location] = {}
        self.photos: list[_LocatedPhoto] = []
        self.grid: Grid | None = None
        self._start: int | None = None
        self._rate_faults: list[str] = []
        self._add: dict[str, Callable[[BagMessage, _Location], None]] = {
            topic_names.RIG: self._add_rig,
            topic_names.SETPOINT: self._add_setpoint,
            topic_names.MEASURED: self._add_measured,
            topic_names.NEW_STATE: self._add_state,
            topic_names.IMAGE: self._add_photo,
            topic_names.BASELINE: self._add_baseline,
        }

    def collect(self, names: dict[str, str]) -> None:
        """Read the topics `names` (absolute name to relative name) of the first experiment."""
        for location, message in _located(self.bag.messages(list(names))):
            relative = names[message.topic]
            if relative != topic_names.CLEAN_STATE:
                self._add[relative](message, location)
            elif self.bag.decode(message).cause == _START:
                stamp = stamp_of(message.data)
                if self.maps and stamp < max(self.maps):
                    path = self.bag.path
                    self.bag.remark(f'{path}: a second experiment begins; only the first is read')
                    break
                self._start = stamp if self._start is None else self._start

    def start_stamp(self) -> int:
        """Return the start of the experiment [ns]: its CleanState message or the first stamp."""
        if self._start is not None:
            return self._start
        states = (photo.stamp for photo in self.photos if photo.role == 'state')
        return min((*self.commanded, *self.measured, *self.maps, *states), default=0)

    def remove_unknown_wells(self, rig: Rig) -> None:
        """Remove rates of wells that `rig` lacks, and remark on all rates that were left out.

        Raises:
            InputError: no rates remain, so the bag belongs to another rig.
        """
        any_recorded = bool(self.commanded or self.measured)
        for rates in (self.commanded, self.measured):
            for stamp in list(rates):
                unknown = [well for well in rates[stamp] if well not in rig.wells]
                if unknown:
                    del rates[stamp]
                    known = ', '.join(rig.wells)
                    self._rate_faults.append(f"unknown well '{unknown[0]}'; the rig has {known}")
        path, faults = self.bag.path, self._rate_faults
        if any_recorded and not (self.commanded or self.measured):
            raise InputError(f'{path}: rates name an {faults[-1]}')
        if faults:
            self.bag.remark(f'{path}: {len(faults)} messages of rates left out: {faults[0]}')

    def _add_rig(self, message: BagMessage, _: _Location) -> None:
        try:
            self.rig = rig_from_msg(self.bag.decode(message))
        except InputError as error:  # the caller's rig.yaml may replace it
            self.rig_fault = str(error)

    def _add_setpoint(self, message: BagMessage, _: _Location) -> None:
        wells = self.bag.decode(message).wells
        self._add_rates(self.commanded, stamp_of(message.data), wells)

    def _add_measured(self, message: BagMessage, _: _Location) -> None:
        rates = self.bag.decode(message)
        start = int(rates.start.sec) * SECOND + int(rates.start.nanosec)
        self._add_rates(self.measured, start, rates.wells)

    def _add_rates(self, rates: dict[int, WellRates], stamp: int, wells: Any) -> None:
        try:
            rates[stamp] = rates_from_msg(wells)
        except InputError as error:  # the hub ignored this message, too
            self._rate_faults.append(str(error))

    def _add_state(self, message: BagMessage, location: _Location) -> None:
        if self.grid is None:
            grid = self.bag.decode(message).tracer.grid
            self.grid = Grid(int(grid.nx), int(grid.nz), float(grid.width), float(grid.height))
        self.maps[stamp_of(message.data)] = location

    def _add_photo(self, message: BagMessage, location: _Location) -> None:
        self._add_image(message, location, 'state')

    def _add_baseline(self, message: BagMessage, location: _Location) -> None:
        self._add_image(message, location, 'baseline')

    def _add_image(self, message: BagMessage, location: _Location, role: Role) -> None:
        first_bytes = bytes(self.bag.decode(message).data[:2])
        number = sum(known.role == role for known in self.photos) + 1
        name = f'photos/{role}_{number:04d}{_SUFFIXES.get(first_bytes, ".img")}'
        self.photos.append(_LocatedPhoto(role, stamp_of(message.data), location, name))


def _schedule(rates: dict[int, WellRates], start: int) -> Schedule | None:
    """Return rates by stamp [ns] as a schedule that begins at `start` [ns]."""
    if not rates:
        return None
    by_time = {max(0, stamp - start) / SECOND: rates[stamp] for stamp in sorted(rates)}
    return Schedule.from_rates(by_time.items())


def _maps(collected: _Collector, start: int, rig: Rig) -> ConcentrationMaps | None:
    """Return the tracer maps, which are decoded when they are read.

    Raises:
        InputError: the maps have another size than the rig.
    """
    grid, bag = collected.grid, collected.bag
    if not collected.maps or grid is None:
        return None
    sizes, expected = (grid.width, grid.height), (rig.width_m, rig.height_m)
    if not np.allclose(sizes, expected, rtol=_SIZE_TOLERANCE):
        raise InputError(
            f'{bag.path}: its maps cover {grid.width:g} x {grid.height:g} m, '
            f'the rig {rig.width_m:g} x {rig.height_m:g} m; name the rig.yaml it was recorded with'
        )
    stamps = sorted(collected.maps)
    locations = [collected.maps[stamp] for stamp in stamps]
    times = np.array([(stamp - start) / SECOND for stamp in stamps])

    def read(first: int, last: int) -> Maps:
        maps = np.empty((last - first, *grid.shape), dtype=np.float32)
        numbers = {location: number for number, location in enumerate(locations[first:last])}
        for location, message in _between(bag, locations[first:last]):
            if (number := numbers.get(location)) is not None:
                maps[number] = _map_values(bag, message, grid, times[first + number])
        return maps

    return ConcentrationMaps(times, rig.grid(grid.nx, grid.nz), read)


def _map_values(bag: BagReader, message: BagMessage, grid: Grid, time: float) -> Maps:
    """Return the map (nz, nx) in a state message.

    Raises:
        InputError: it lies on another grid.
    """
    values = np.asarray(bag.decode(message).tracer.concentration)
    if values.size != grid.nx * grid.nz:
        raise InputError(
            f'{bag.path}: the map at {time:g} s has {values.size} values, '
            f'but earlier maps lie on {grid}; export the parts one by one'
        )
    return values.reshape(grid.shape)


def _photos(collected: _Collector, start: int) -> tuple[Photo, ...]:
    photos = [
        Photo(
            (photo.stamp - start) / SECOND,
            photo.role,
            photo.name,
            _image_reader(collected.bag, photo.location),
        )
        for photo in collected.photos
    ]
    return tuple(sorted(photos, key=lambda photo: photo.time))


def _image_reader(bag: BagReader, photo: _Location) -> Callable[[], bytes]:
    def read() -> bytes:
        for location, message in _between(bag, [photo]):
            if location == photo:
                return bytes(bag.decode(message).data)
        raise InputError(f'{bag.path}: changed while it was read; open it again')

    return read
