"""The experiment in a bag: rig, rates, tracer maps and photographs from recorded messages."""

import logging
import math
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.photo_list import Role
from porotwin_core.basis.remark import NAMED
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import KnownRates
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_core.ros.from_messages import nanoseconds_from_msg, rates_from_msg, rig_from_msg
from porotwin_recording.experiment.joined_bags import refuse_two_experiments, refuse_two_rigs
from porotwin_recording.experiment.rig_pauses import with_pauses
from porotwin_recording.experiment.segments import (
    LocatedPhoto,
    Location,
    PhotoKey,
    Segment,
    ToldRates,
    joined,
)
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_reader import BagMessage, BagReader
from porotwin_recording.mcap.serialization import SECOND, STAMP_END, stamp_of
from porotwin_recording.tables.concentration import (
    DEVIATIONS,
    ConcentrationMaps,
    MapOrigin,
    Maps,
    MapSeries,
    without_impossible,
)
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.rates import measured_to
from porotwin_recording.tables.recorded_data import RecordedData

_START, _INTERRUPTED = 0, 1
"""Values of CleanState.cause; a bag is read without the installed message classes."""

IMPORTED = 'imported experiment begins'
"""Reason in the CleanState message of a bag that was made from the tables of a folder."""


_SUFFIXES = {b'\xff\xd8': '.jpg', b'\x89P': '.png', b'II': '.tif', b'MM': '.tif'}
"""Suffix of an image file by its first two bytes."""

HEAD_BYTES = 4096
"""Bytes that tell one photograph from another: its stamp, length, EXIF data and first pixels."""

_PHOTOS = (topic_names.IMAGE, topic_names.BASELINE)
_NUMBERS = (topic_names.NEW_STATE, topic_names.SETPOINT, topic_names.MEASURED)
_LARGE = (topic_names.NEW_STATE, *_PHOTOS)
"""Topics whose messages are read later, one by one."""

LOG = logging.getLogger('porotwin')


def read_bag(path: Path, rig: Rig | None = None, *, segment: int | None = None) -> RecordedData:
    """Return the experiment in the bag at `path`; a given `rig` replaces the recorded one.

    - Time zero is the stamp of the CleanState message that starts the experiment, else the first
      stamp. Earlier rates hold from time zero on.
    - If two maps, photographs or rates have the same stamp, the later message counts.
    - The rates in force are those of `RateHistory`, as in the hub. They count as measured where
      they differ from the setpoints. In a bag that was made from tables the tables count.
    - A sequence that begins again goes on with the same experiment, for example after a restart of
      a node. A remark says so. Photographs that are sent again replace the earlier ones.
    - If another experiment begins in the same bag, the `segment` is read (counted from 1), or the
      one with most states. See `segments` for what counts as another experiment.
    - Rates that are not finite or belong to unknown wells are left out, as in the hub.

    Raises:
        InputError: no bag, a bag without a rig, bags of two rigs or two experiments with the same
            times, maps of another rig, or no such segment.
    """
    bag = BagReader(path)
    collector = _Collector(bag)
    try:
        if rig is None:
            refuse_two_rigs(bag)
        collector.collect(_experiment_topics(bag))
    except AttributeError as error:
        raise InputError(
            f'{path}: recorded with other interfaces ({error}); read it with the version of '
            'PoroTwin that made it'
        ) from None
    replaced = None if rig is None else collector.rig
    if rig is None:
        rig = collector.rig
    if rig is None:
        raise InputError(f'{path}: {collector.rig_fault}; name its rig.yaml with --rig')
    collector.remove_unknown_wells(rig)
    chosen = _chosen(bag, joined(collector.segments), segment)
    start = chosen.start_stamp()
    left_out: list[str] = []
    if collector.imported:
        measured = _tabled(chosen, start)
    else:
        measured = _delivered(chosen, start, rig, left_out)
    return RecordedData(
        rig,
        commanded=_schedule(chosen, start, are_orders=True),
        measured=measured,
        maps=_maps(bag, chosen, start, rig),
        photos=_photos(bag, chosen, start),
        remarks=(*bag.remarks, *left_out[:1]),
        replaced_rig=replaced,
        by_hand=not collector.imported
        and all(one.is_order or one.end <= one.start for one in chosen.told),
    )


def _chosen(bag: BagReader, segments: list[Segment], number: int | None) -> Segment:
    """Return segment `number` (from 1), or the one with most states; remark on the others.

    Raises:
        InputError: there is no such segment.
    """
    count = len(segments)
    if number is not None and not 1 <= number <= count:
        held = 'one experiment' if count == 1 else f'{count} experiments'
        raise InputError(f'{bag.path}: holds {held}; choose a segment from 1 to {count}')
    index = number - 1 if number else max(range(count), key=lambda i: segments[i].state_count)
    chosen = segments[index]
    if count > 1:
        held = '; '.join(f'{n} with {s.state_count} states' for n, s in enumerate(segments, 1))
        bag.remark(
            f'{bag.path}: holds {count} experiments ({held}); segment {index + 1} is read; '
            'choose another with ./porotwin export --segment'
        )
    if chosen.interruptions:
        first = chosen.start_stamp()
        moments = ', '.join(f'{(at - first) / SECOND:g}' for at in chosen.interruptions[:NAMED])
        more = ', ...' if len(chosen.interruptions) > NAMED else ''
        bag.remark(
            f'{bag.path}: {len(chosen.interruptions) + 1} parts of one experiment joined; the '
            f'sequence of states began again at {moments}{more} s'
        )
    return chosen


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


def image_begin(data: bytes) -> bytes:
    """Return the length (4 bytes) and the first bytes of the file in a CompressedImage (CDR).

    Raises:
        InputError: the bytes are no CompressedImage.
    """
    try:
        length_of = struct.Struct('<I' if data[1] & 1 else '>I').unpack_from
        position = STAMP_END
        for _ in ('frame_id', 'format'):
            (length,) = length_of(data, position)
            position += 4 + length + -length % 4
        length_of(data, position)
    except (struct.error, IndexError):
        raise InputError("message is not a 'sensor_msgs/msg/CompressedImage'") from None
    return data[position:HEAD_BYTES]


def _located(messages: Iterable[BagMessage]) -> Iterator[tuple[Location, BagMessage]]:
    """Yield messages with their locations."""
    last: dict[str, Location] = {}
    for message in messages:
        before = last.get(message.topic)
        repeated = before is not None and before.log_time == message.log_time
        number = before.number + 1 if before is not None and repeated else 0
        last[message.topic] = Location(message.topic, message.log_time, number)
        yield last[message.topic], message


def _between(bag: BagReader, locations: list[Location]) -> Iterator[tuple[Location, BagMessage]]:
    """Yield the messages from the first to the last of `locations`, all of one topic."""
    if locations:
        log_times = [location.log_time for location in locations]
        topic, stop = locations[0].topic, max(log_times) + 1
        yield from _located(bag.messages([topic], start=min(log_times), stop=stop))


def foreign_positions(numbers: Iterable[int]) -> set[int]:
    """Return the positions of setpoints that no hub sent, from the recorded `numbers` in order.

    A hub counts up and a new hub begins with 1. The guard refuses some, so that numbers are
    skipped. A block is foreign if the row goes on after it with a number between: it lies between
    a and b with a < b, and all its numbers are greater than b.

    A foreign number at the start or at the end cannot be told, nor one that is in the row, nor one
    before a new hub. True numbers are taken for foreign ones only if a new hub's first ones are
    missing, and its first recorded number was missing from the earlier hub: 1, 3, 2.
    """
    row: list[tuple[int, int]] = []
    foreign: set[int] = set()
    for position, number in enumerate(numbers):
        end = len(row)
        while end and row[end - 1][1] > number:
            end -= 1
        if end and row[end - 1][1] < number:
            foreign.update(at for at, _ in row[end:])
            del row[end:]
        row.append((position, number))
    return foreign


class _Collector:
    """Collects the experiments in one pass over a bag; maps and photographs stay on disk."""

    def __init__(self, bag: BagReader) -> None:
        self.bag = bag
        self.rig: Rig | None = None
        self.rig_fault = 'holds no rig description'
        self.segments = [Segment()]
        self._rate_faults: list[str] = []
        self._copies = 0
        self.imported = False
        """Whether the bag was made from the tables of a folder."""
        self._setpoints: list[tuple[int, ToldRates | None]] = []
        """Numbers and rates of the setpoints; None: the rates were wrong."""
        self._add: dict[str, Callable[[BagMessage, Location], None]] = {
            topic_names.RIG: self._add_rig,
            topic_names.SETPOINT: self._add_setpoint,
            topic_names.MEASURED: self._add_measured,
            topic_names.NEW_STATE: self._add_state,
            topic_names.CLEAN_STATE: self._add_clean_state,
            topic_names.IMAGE: self._add_photo,
            topic_names.BASELINE: self._add_baseline,
        }

    def collect(self, names: dict[str, str]) -> None:
        """Read the topics `names` (absolute name to relative name).

        Raises:
            InputError: the bags of a folder hold two experiments.
        """
        faults: dict[str, list[str]] = {}
        simultaneous = False
        heads = {name: HEAD_BYTES for name in names if names[name] in _LARGE}
        for location, message in _located(self.bag.messages(list(names), heads=heads)):
            simultaneous |= location.number > 0
            try:
                self._add[names[message.topic]](message, location)
            except InputError as error:  # one wrong message costs that message
                faults.setdefault(message.topic, []).append(str(error))
        if simultaneous:
            photos = {name: head for name, head in heads.items() if names[name] in _PHOTOS}
            compared = [name for name in names if names[name] in (*_PHOTOS, *_NUMBERS)]
            refuse_two_experiments(self.bag, compared, photos)
        if self._copies:
            self.bag.remark(
                f'{self.bag.path}: {self._copies} maps and photographs are in it twice, with one '
                'time of recording, and are read once; does its folder hold two copies of one bag?'
            )
        self._leave_out_foreign_setpoints()
        for topic, lines in faults.items():
            self.bag.remark(
                f"{self.bag.path}: {len(lines)} messages of '{topic}' left out: {lines[0]}"
            )

    def _leave_out_foreign_setpoints(self) -> None:
        """Leave out setpoints that no hub sent."""
        numbers = [number for number, _ in self._setpoints]
        foreign = foreign_positions(numbers)
        if not foreign:
            return
        left_out = {id(self._setpoints[position][1]) for position in foreign}
        for part in self.segments:
            part.told = [one for one in part.told if id(one) not in left_out]
        self.bag.remark(
            f'{self.bag.path}: {len(foreign)} setpoints left out, the first with the number '
            f'{numbers[min(foreign)]}: it is not in the row of the others, so that another program '
            'than the hub sent it'
        )

    def remove_unknown_wells(self, rig: Rig) -> None:
        """Remove rates of wells that `rig` lacks, and remark on all rates that were left out.

        Raises:
            InputError: no rates remain, so the bag belongs to another rig.
        """
        any_recorded = any(part.told for part in self.segments)
        for part in self.segments:
            told, part.told = part.told, []
            for one in told:
                unknown = next((well for well in one.rates if well not in rig.wells), None)
                if unknown is None:
                    part.told.append(one)
                else:
                    known = ', '.join(rig.wells)
                    self._rate_faults.append(f"unknown well '{unknown}'; the rig has {known}")
        path, faults = self.bag.path, self._rate_faults
        if any_recorded and not any(part.told for part in self.segments):
            raise InputError(f'{path}: rates name an {faults[-1]}')
        if faults:
            self.bag.remark(f'{path}: {len(faults)} messages of rates left out: {faults[0]}')

    def _add_rig(self, message: BagMessage, _: Location) -> None:
        try:
            rig = rig_from_msg(self.bag.decode(message))
            self.rig = with_pauses(rig, self.bag.topics[message.topic].pauses)
        except InputError as error:  # the caller's rig.yaml may replace it
            self.rig_fault = str(error)

    def _add_setpoint(self, message: BagMessage, _: Location) -> None:
        setpoint = self.bag.decode(message)
        until = nanoseconds_from_msg(setpoint.valid_until)
        told = self._add_rates(stamp_of(message.data), until, setpoint.wells, is_order=True)
        self._setpoints.append((int(setpoint.sequence), told))

    def _add_measured(self, message: BagMessage, _: Location) -> None:
        rates = self.bag.decode(message)
        end = stamp_of(message.data)
        self._add_rates(nanoseconds_from_msg(rates.start), end, rates.wells, is_order=False)

    def _add_rates(self, start: int, end: int, wells: Any, *, is_order: bool) -> ToldRates | None:
        try:
            told = ToldRates(start, end, rates_from_msg(wells), is_order)
        except InputError as error:  # the hub ignored this message, too
            self._rate_faults.append(str(error))
            return None
        self.segments[-1].told.append(told)
        return told

    def _add_clean_state(self, message: BagMessage, _: Location) -> None:
        event = self.bag.decode(message)
        self.imported |= event.reason == IMPORTED
        if event.cause in (_START, _INTERRUPTED):
            stamp, starts = stamp_of(message.data), event.cause == _START
            self.segments += self.segments[-1].restarted(stamp, starts=starts)

    def _add_state(self, message: BagMessage, location: Location) -> None:
        stamp = stamp_of(message.data)
        self._copies += location.number > 0 and stamp in self.segments[-1].maps
        self.segments[-1].add_map(stamp, location)

    def _add_photo(self, message: BagMessage, location: Location) -> None:
        self._add_image(message, location, 'state')

    def _add_baseline(self, message: BagMessage, location: Location) -> None:
        self._add_image(message, location, 'baseline')

    def _add_image(self, message: BagMessage, location: Location, role: Role) -> None:
        begin = image_begin(message.data)
        key = PhotoKey(role, stamp_of(message.data), zlib.crc32(begin))
        suffix = _SUFFIXES.get(begin[4:6], '.img')
        self._copies += location.number > 0 and key in self.segments[-1].photos
        self.segments[-1].photos[key] = LocatedPhoto(location, suffix)


def _schedule(segment: Segment, start: int, *, are_orders: bool) -> Schedule | None:
    """Return setpoints or measured rates as a schedule that begins at `start` [ns]."""
    told = sorted(
        (one for one in segment.told if one.is_order == are_orders), key=lambda one: one.start
    )
    by_time = {max(0, one.start - start) / SECOND: one.rates for one in told}
    return Schedule.from_rates(by_time.items()) if told else None


def _tabled(segment: Segment, start: int) -> Schedule | None:
    """Return measured rates as the table that an import has read; they go on to its last row."""
    schedule = _schedule(segment, start, are_orders=False)
    if schedule is None or not schedule.rows:
        return schedule
    end = max(one.start for one in segment.told if not one.is_order)
    return measured_to(schedule, max(0, end - start) / SECOND)


def _delivered(segment: Segment, start: int, rig: Rig, left_out: list[str]) -> Schedule | None:
    """Return the rates in force as the messages told them; None where they are the setpoints.

    Rates that no pump can have are not used, as in the hub; `left_out` gets a line about each.
    """
    if not segment.told:
        return None
    history = RateHistory.of(rig)
    history.reach(0.0)
    history.most_events = len(segment.told)
    for one in segment.told:
        begin, end = (one.start - start) / SECOND, (one.end - start) / SECOND
        if one.is_order:
            history.add_commanded(begin, one.rates, end)
        else:
            try:
                history.add_known(KnownRates(begin, end, one.rates))
            except InputError as error:
                left_out.append(f'measured rates at {begin:.0f} s are left out: {error}')
    ends = (one.start if one.is_order else one.end for one in segment.told)
    states = (key.stamp for key in segment.photos if key.role == 'state')
    end = (max(*ends, *segment.maps, *states, start) - start) / SECOND
    periods = history.traced(0.0, math.nextafter(end, math.inf))
    found = Schedule.from_rates((period.start, period.rates) for period in periods)
    if found == _schedule(segment, start, are_orders=True):
        return None
    return measured_to(found, end)


def _maps(bag: BagReader, segment: Segment, start: int, rig: Rig) -> ConcentrationMaps | None:
    """Return the tracer maps, which are decoded when they are read.

    Raises:
        InputError: the maps have another size than the rig.
    """
    first = _first_state(bag, segment)
    if first is None:
        return None
    state, origin, grid = first
    cells = rig.grid(grid.nx, grid.nz)
    if not grid.covers_the_same(cells):
        raise InputError(
            f'{bag.path}: its maps cover {grid.width:g} x {grid.height:g} m, '
            f'the rig {rig.width_m:g} x {rig.height_m:g} m; name the rig.yaml it was recorded with'
        )
    stamps = sorted(segment.maps)
    locations = [segment.maps[stamp] for stamp in stamps]
    times = np.array([(stamp - start) / SECOND for stamp in stamps])

    def reader(values_of: Callable[[Any], Any]) -> Callable[[int, int], Maps]:
        def read(first: int, last: int) -> Maps:
            maps = np.full((last - first, *grid.shape), np.nan, dtype=np.float32)
            numbers = {location: number for number, location in enumerate(locations[first:last])}
            for location, message in _between(bag, locations[first:last]):
                if (number := numbers.get(location)) is None:
                    continue
                time = times[first + number]
                try:
                    values = np.asarray(values_of(bag.decode(message)))
                except InputError as error:  # one wrong message costs that message
                    LOG.warning('%s; the map at %g s is left unknown', error, time)
                    continue
                maps[number] = _map_values(bag, values, grid, time)
            return maps

        return read

    deviations = {
        name: MapSeries(times, cells, reader(_deviation_reader(name, grid)))
        for name in DEVIATIONS
        if len(getattr(state, name, ()))
    }
    recorded = reader(lambda message: message.tracer.concentration)

    def read(first: int, last: int) -> Maps:
        return without_impossible(recorded(first, last), bag.path)

    return ConcentrationMaps(times, cells, read, **deviations, origin=origin)


def _first_state(bag: BagReader, segment: Segment) -> tuple[Any, MapOrigin, Grid] | None:
    """Return the first readable state of a segment, how its map was made, and its grid.

    States before it that cannot be read are removed, with a remark. None: there is no state.
    """
    faults: list[str] = []
    for stamp in sorted(segment.maps):
        wanted = segment.maps[stamp]
        found = (message for location, message in _between(bag, [wanted]) if location == wanted)
        try:
            state = next((bag.decode(message) for message in found), None)
        except InputError as error:
            state, faults = None, [*faults, str(error)]
        if state is None:
            del segment.maps[stamp]
            continue
        if faults:
            bag.remark(f'{faults[0]}; {len(faults)} states are left out')
        grid = state.tracer.grid
        cells = Grid(int(grid.nx), int(grid.nz), float(grid.width), float(grid.height))
        return state, origin_of_state(state, bag.topics[wanted.topic].program), cells
    if faults:
        bag.remark(f'{faults[0]}; none of {len(faults)} states can be read')
    return None


def origin_of_state(state: Any, program: str | None) -> MapOrigin:
    """Return how the maps of a topic were made, from a state message and its program, if known."""
    # an imported folder may hold maps of unknown origin, which count as calibrated
    unknown = program == '' and state.calibrated
    calibration = getattr(state, 'calibration', '')
    return MapOrigin(None if unknown else state.calibrated, calibration, program or '')


def _deviation_reader(name: str, grid: Grid) -> Callable[[Any], Any]:
    """Return the function that reads the field `name` of a state; NaN where a state has none."""

    def values_of(state: Any) -> Any:
        values = getattr(state, name)
        return values if len(values) else np.full(grid.shape, np.nan, dtype=np.float32)

    return values_of


def _map_values(bag: BagReader, values: Maps, grid: Grid, time: float) -> Maps:
    """Return the `values` of a state message as a map (nz, nx).

    Raises:
        InputError: they lie on another grid.
    """
    if values.size != grid.nx * grid.nz:
        raise InputError(
            f'{bag.path}: the map at {time:g} s has {values.size} values, '
            f'but earlier maps lie on {grid}; export the parts one by one'
        )
    return values.reshape(grid.shape)


def _photos(bag: BagReader, segment: Segment, start: int) -> tuple[Photo, ...]:
    """Return the photographs, ordered by time and numbered by role."""
    numbers: dict[Role, int] = {}
    photos = []
    for key, photo in sorted(segment.photos.items(), key=lambda item: item[0].stamp):
        numbers[key.role] = numbers.get(key.role, 0) + 1
        name = f'photos/{key.role}_{numbers[key.role]:04d}{photo.suffix}'
        read = _image_reader(bag, photo.location)
        photos.append(Photo((key.stamp - start) / SECOND, key.role, name, read))
    return tuple(photos)


def _image_reader(bag: BagReader, photo: Location) -> Callable[[], bytes]:
    def read() -> bytes:
        for location, message in _between(bag, [photo]):
            if location == photo:
                return bytes(bag.decode(message).data)
        raise InputError(f'{bag.path}: changed while it was read; open it again')

    return read
