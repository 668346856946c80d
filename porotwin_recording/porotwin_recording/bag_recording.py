"""An experiment out of a bag: rig, rates, tracer maps and photographs from recorded messages."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.from_messages import rates_from_msg, rig_from_msg
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule, WellRates
from porotwin_recording import topics
from porotwin_recording.bag_reader import BagMessage, BagReader
from porotwin_recording.concentration import ConcentrationMaps, Maps
from porotwin_recording.experiment import Experiment
from porotwin_recording.photos import Photo, Role
from porotwin_recording.serialization import SECOND, stamp_of

_START = 0
"""CleanState.START, as the bag's own definition has it."""

_SUFFIXES = {b'\xff\xd8': '.jpg', b'\x89P': '.png', b'II': '.tif', b'MM': '.tif'}


@dataclass(frozen=True)
class _Place:
    """Where a message lies in a bag: the `number`th of its topic with the same log time [ns]."""

    topic: str
    log_time: int
    number: int


def _placed(messages: Iterable[BagMessage]) -> Iterator[tuple[_Place, BagMessage]]:
    last: dict[str, _Place] = {}
    for message in messages:
        before = last.get(message.topic)
        number = 0
        if before is not None and before.log_time == message.log_time:
            number = before.number + 1
        place = _Place(message.topic, message.log_time, number)
        last[message.topic] = place
        yield place, message


@dataclass(frozen=True)
class _FoundPhoto:
    role: Role
    stamp: int
    place: _Place
    name: str


@dataclass
class _Found:
    """What a pass over a bag gathers; times are stamps [ns]."""

    start: int | None = None
    rig: Rig | None = None
    rig_problem: str = 'holds no rig description'
    wrong_rates: list[str] = field(default_factory=list)
    told: dict[int, WellRates] = field(default_factory=dict)
    measured: dict[int, WellRates] = field(default_factory=dict)
    frames: dict[int, _Place] = field(default_factory=dict)
    photos: list[_FoundPhoto] = field(default_factory=list)
    grid: Grid | None = None

    def first(self) -> int:
        """Return when the experiment starts: where it says so, else with what happens first."""
        if self.start is not None:
            return self.start
        states = (photo.stamp for photo in self.photos if photo.role == 'state')
        return min((*self.told, *self.measured, *self.frames, *states), default=0)


def read_bag(path: Path, rig: Rig | None = None) -> Experiment:
    """Return the experiment that the bag at `path` recorded.

    Time zero is the stamp of the CleanState message that starts the experiment, or the first
    stamp where there is none; rates told before count from zero on. A state or setpoint that was
    sent twice for the same time counts as sent last; a setpoint counts as told until the next one,
    whatever its validity (the measured rates know what the pumps then did). Where the time goes
    back to a new start, the rest is another experiment and left out. Rates that are not finite or
    name unknown wells are left out with a remark, as the hub ignored them.

    Raises:
        InputError: not a bag, damaged, without a rig, or not recorded from a twin of this rig.
    """
    bag = BagReader(path)
    names = _names(bag)
    try:
        found = _gather(bag, names)
    except AttributeError as error:
        raise InputError(
            f'{path}: recorded with other interfaces ({error}); read it with the version of '
            'PoroTwin that made it'
        ) from None
    if rig is None:
        rig = found.rig
    if rig is None:
        raise InputError(f'{path}: {found.rig_problem}; name its rig.yaml with --rig')
    _leave_out_wrong_rates(bag, found, rig)
    start = found.first()
    return Experiment(
        rig,
        _schedule(found.told, start),
        _schedule(found.measured, start),
        _maps(bag, found, start, rig),
        _photos(bag, found, start),
        tuple(bag.remarks),
    )


def _names(bag: BagReader) -> dict[str, str]:
    """Return the topics of an experiment in the bag: name there to name in the namespace."""
    names: dict[str, str] = {}
    for relative in (
        topics.RIG,
        topics.SETPOINT,
        topics.MEASURED,
        topics.NEW_STATE,
        topics.CLEAN_STATE,
        topics.IMAGE,
        topics.BASELINE,
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


def _nanoseconds(time: Any) -> int:
    return int(time.sec) * SECOND + int(time.nanosec)


def _gather(bag: BagReader, names: dict[str, str]) -> _Found:
    found = _Found()
    for place, message in _placed(bag.messages(list(names))):
        relative = names[message.topic]
        if relative != topics.CLEAN_STATE:
            _TAKERS[relative](found, bag, message, place)
        elif bag.decode(message).cause == _START:
            stamp = stamp_of(message.data)
            if found.frames and stamp < max(found.frames):
                bag.remark(f'{bag.path}: a second experiment begins in it; only the first is read')
                break
            found.start = stamp if found.start is None else found.start
    return found


def _take_rig(found: _Found, bag: BagReader, message: BagMessage, _: _Place) -> None:
    try:
        found.rig = rig_from_msg(bag.decode(message))
    except InputError as error:  # a rig.yaml may take its place
        found.rig_problem = str(error)


def _take_setpoint(found: _Found, bag: BagReader, message: BagMessage, _: _Place) -> None:
    _add_rates(found, found.told, stamp_of(message.data), bag.decode(message).wells)


def _take_measured(found: _Found, bag: BagReader, message: BagMessage, _: _Place) -> None:
    rates = bag.decode(message)
    _add_rates(found, found.measured, _nanoseconds(rates.start), rates.wells)


def _add_rates(found: _Found, rates: dict[int, WellRates], stamp: int, wells: Any) -> None:
    try:
        rates[stamp] = rates_from_msg(wells)
    except InputError as error:  # the hub heard the same and went on without
        found.wrong_rates.append(str(error))


def _take_state(found: _Found, bag: BagReader, message: BagMessage, place: _Place) -> None:
    if found.grid is None:
        grid = bag.decode(message).tracer.grid
        found.grid = Grid(int(grid.nx), int(grid.nz), float(grid.width), float(grid.height))
    found.frames[stamp_of(message.data)] = place


def _take_photo(found: _Found, bag: BagReader, message: BagMessage, place: _Place) -> None:
    _add_photo(found, bag, message, place, 'state')


def _take_baseline(found: _Found, bag: BagReader, message: BagMessage, place: _Place) -> None:
    _add_photo(found, bag, message, place, 'baseline')


def _add_photo(
    found: _Found, bag: BagReader, message: BagMessage, place: _Place, role: Role
) -> None:
    begin = bytes(bag.decode(message).data[:2])
    number = sum(known.role == role for known in found.photos) + 1
    name = f'photos/{role}_{number:04d}{_SUFFIXES.get(begin, ".img")}'
    found.photos.append(_FoundPhoto(role, stamp_of(message.data), place, name))


_TAKERS: dict[str, Callable[[_Found, BagReader, BagMessage, _Place], None]] = {
    topics.RIG: _take_rig,
    topics.SETPOINT: _take_setpoint,
    topics.MEASURED: _take_measured,
    topics.NEW_STATE: _take_state,
    topics.IMAGE: _take_photo,
    topics.BASELINE: _take_baseline,
}


def _leave_out_wrong_rates(bag: BagReader, found: _Found, rig: Rig) -> None:
    """Leave out rates that name a well which `rig` has not, and say how many are left out in all.

    Raises:
        InputError: no rates are left: it is another rig.
    """
    heard = bool(found.told or found.measured)
    for rates in (found.told, found.measured):
        for stamp in list(rates):
            unknown = [well for well in rates[stamp] if well not in rig.wells]
            if unknown:
                del rates[stamp]
                reason = f"unknown well '{unknown[0]}'; the rig has {', '.join(rig.wells)}"
                found.wrong_rates.append(reason)
    if heard and not (found.told or found.measured):
        raise InputError(f'{bag.path}: rates name an {found.wrong_rates[-1]}')
    if found.wrong_rates:
        count = len(found.wrong_rates)
        bag.remark(f'{bag.path}: {count} messages of rates left out: {found.wrong_rates[0]}')


def _schedule(told: dict[int, WellRates], start: int) -> Schedule | None:
    if not told:
        return None
    by_time = {max(0, stamp - start) / SECOND: told[stamp] for stamp in sorted(told)}
    return Schedule.from_rates(by_time.items())


def _maps(bag: BagReader, found: _Found, start: int, rig: Rig) -> ConcentrationMaps | None:
    if not found.frames or found.grid is None:
        return None
    grid = found.grid
    if not np.allclose((grid.width, grid.height), (rig.width_m, rig.height_m), rtol=1e-6):
        raise InputError(
            f'{bag.path}: its maps cover {grid.width:g} x {grid.height:g} m, '
            f'the rig {rig.width_m:g} x {rig.height_m:g} m; name the rig.yaml it was recorded with'
        )
    stamps = sorted(found.frames)
    places = [found.frames[stamp] for stamp in stamps]
    times = np.array([(stamp - start) / SECOND for stamp in stamps])

    def read(first: int, last: int) -> Maps:
        maps = np.empty((last - first, *grid.shape), dtype=np.float32)
        wanted = {place: number for number, place in enumerate(places[first:last])}
        for place, message in _at(bag, places[first:last]):
            number = wanted.get(place)
            if number is None:
                continue
            values = np.asarray(bag.decode(message).tracer.concentration)
            if values.size != grid.nx * grid.nz:
                raise InputError(
                    f'{bag.path}: the map at {times[first + number]:g} s has {values.size} values, '
                    f'those before it lie on {grid}; export the parts one by one'
                )
            maps[number] = values.reshape(grid.shape)
        return maps

    return ConcentrationMaps(times, rig.grid(grid.nx, grid.nz), read)


def _at(bag: BagReader, places: list[_Place]) -> Iterator[tuple[_Place, BagMessage]]:
    """Yield the messages from the first to the last of `places`, all of one topic."""
    if places:
        log_times = [place.log_time for place in places]
        found = bag.messages([places[0].topic], start=min(log_times), stop=max(log_times) + 1)
        yield from _placed(found)


def _photos(bag: BagReader, found: _Found, start: int) -> tuple[Photo, ...]:
    photos = [
        Photo((photo.stamp - start) / SECOND, photo.role, photo.name, _reader(bag, photo.place))
        for photo in found.photos
    ]
    return tuple(sorted(photos, key=lambda photo: photo.time))


def _reader(bag: BagReader, wanted: _Place) -> Callable[[], bytes]:
    def read() -> bytes:
        for place, message in _at(bag, [wanted]):
            if place == wanted:
                return bytes(bag.decode(message).data)
        raise InputError(f'{bag.path}: changed while it was read; open it again')

    return read
