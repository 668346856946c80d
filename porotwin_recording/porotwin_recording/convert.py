"""An experiment folder turned into a bag, and a bag into a folder, without losing anything.

Kept exactly: every tracer map as float32, every photograph byte for byte, times to the nanosecond,
every change of a rate, the rig with its maps. A packed map file comes back as float32 with the same
values. Photographs are renamed by role and number; a map file of the rig after its quantity. Of a
live bag a folder takes the experiment alone, without predictions, reports and diagnostics.
"""

import array
import heapq
import math
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from porotwin_core.conversions import CAMERA_FRAME, RIG_FRAME, grid_to_msg, rates_to_msg, rig_to_msg
from porotwin_core.errors import InputError
from porotwin_core.wells import Schedule, WellRate
from porotwin_msgs.msg import (
    CleanState,
    NewState,
    Setpoint,
    StateRefreshed,
    TracerField,
    WellRates,
)
from porotwin_recording import topics
from porotwin_recording.bag_writer import BagWriter
from porotwin_recording.experiment import write_experiment
from porotwin_recording.photos import Photo
from porotwin_recording.recording import Recording, open_recording
from porotwin_recording.serialization import SECOND, Serializer, message_type
from porotwin_recording.topic import TopicQos

IMPORT_START = 1_000_000_000 * SECOND
"""Stamp of the start of an imported experiment [ns], the same for all: 2001-09-09 01:46:40 UTC."""

Progress = Callable[[int, int], None]
"""Is told how many of how many maps and photographs are done."""

_QOS = {
    topics.RIG: TopicQos(depth=1, durability='transient_local'),
    topics.BASELINE: TopicQos(durability='transient_local'),
    topics.SETPOINT: TopicQos(depth=1),
}


def import_experiment(
    folder: Path | str, bag: Path | str, *, progress: Progress | None = None
) -> None:
    """Write the experiment in `folder` as the bag that its live recording would have been.

    The bag appears when it is complete; after an error there is none.

    Raises:
        InputError: one line naming what is wrong in the folder, or that the bag exists.
    """
    recording = open_recording(folder)
    serializer = Serializer()
    counts: dict[str, int] = {}
    total = len(recording.photos) + (len(recording.maps) if recording.maps else 0)
    done = 0
    with _whole(Path(bag)) as place, BagWriter(place) as writer:
        for stamp, topic, message in _messages(recording):
            name = f'{topics.NAMESPACE}/{topic}'
            writer.add_topic(name, message_type(message), qos=_QOS.get(topic))
            counts[name] = counts.get(name, 0) + 1
            writer.write(name, serializer.to_cdr(message), log_time=stamp, sequence=counts[name])
            if progress and topic in (topics.NEW_STATE, topics.IMAGE, topics.BASELINE):
                done += 1
                progress(done, total)


def export_bag(bag: Path | str, folder: Path | str, *, progress: Progress | None = None) -> None:
    """Write the experiment in `bag` as a folder.

    The folder appears when it is complete; after an error there is none.

    Raises:
        InputError: one line naming what is wrong with the bag, or that the folder is taken.
    """
    recording = open_recording(bag)
    with _whole(Path(folder)) as place:
        write_experiment(
            place,
            rig=recording.rig,
            told=recording.told,
            measured=recording.measured,
            maps=recording.maps,
            photos=recording.photos,
            progress=progress,
        )


@contextmanager
def _whole(target: Path) -> Iterator[Path]:
    """Yield where to write what takes the name `target` once it is whole, and goes if it fails."""
    if target.exists():
        raise InputError(f'{target}: exists already; name another or remove it')
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        beside = tempfile.TemporaryDirectory(prefix=f'.{target.name}-', dir=target.parent)
    except OSError as error:
        raise InputError(f'{target}: cannot be written ({error.strerror})') from None
    with beside as folder:
        place = Path(folder, target.name)
        yield place
        place.rename(target)


def _messages(recording: Recording) -> Iterator[tuple[int, str, Any]]:
    """Yield (stamp [ns], topic, message) of a recording in the order of their times."""
    streams = [
        _opening(recording),
        _setpoints(recording),
        _measured(recording),
        _photographs(recording),
        _states(recording),
    ]
    yield from heapq.merge(*streams, key=lambda item: item[0])


def _stamp(time: float) -> int:
    return IMPORT_START + round(time * SECOND)


def _time(stamp: int) -> Time:
    return Time(sec=stamp // SECOND, nanosec=stamp % SECOND)


def _header(stamp: int, frame: str = RIG_FRAME) -> Header:
    return Header(stamp=_time(stamp), frame_id=frame)


def _opening(recording: Recording) -> Iterator[tuple[int, str, Any]]:
    first = min([0.0, *(photo.time for photo in recording.photos)])
    yield _stamp(first), topics.RIG, rig_to_msg(recording.rig)
    start = CleanState(
        header=_header(IMPORT_START), cause=CleanState.START, reason='imported experiment begins'
    )
    yield IMPORT_START, topics.CLEAN_STATE, start


def _changes(schedule: Schedule) -> Iterator[tuple[float, dict[str, WellRate]]]:
    """Yield the rates of all wells at every time something is told, those told then first."""
    for time in dict.fromkeys(row.time for row in schedule.rows):
        rates = schedule.at(time)
        told = [row.well for row in schedule.rows if row.time == time]
        yield time, {well: rates[well] for well in dict.fromkeys((*told, *rates))}


def _setpoints(recording: Recording) -> Iterator[tuple[int, str, Any]]:
    if recording.told is None:
        return
    times = [row.time for row in recording.told.rows]
    times += [] if recording.maps is None else [recording.maps.times[-1]]
    end = max([*times, *(photo.time for photo in recording.photos)], default=0.0)
    changes = list(_changes(recording.told))
    ends = [*(time for time, _ in changes[1:]), end]
    for number, ((time, rates), until) in enumerate(zip(changes, ends, strict=False)):
        message = Setpoint(
            header=_header(_stamp(time)),
            sequence=number + 1,
            valid_until=_time(_stamp(until)),
            wells=rates_to_msg(rates),
            reason='imported',
        )
        yield _stamp(time), topics.SETPOINT, message


def _measured(recording: Recording) -> Iterator[tuple[int, str, Any]]:
    if recording.measured is None:
        return
    for time, rates in _changes(recording.measured):
        stamp = _stamp(time)
        message = WellRates(header=_header(stamp), start=_time(stamp), wells=rates_to_msg(rates))
        yield stamp, topics.MEASURED, message


def _photographs(recording: Recording) -> Iterator[tuple[int, str, Any]]:
    for photo in recording.photos:
        topic = topics.BASELINE if photo.role == 'baseline' else topics.IMAGE
        yield _stamp(photo.time), topic, _image(photo)


def _image(photo: Photo) -> CompressedImage:
    suffix = Path(photo.name).suffix.lower().lstrip('.')
    return CompressedImage(
        header=_header(_stamp(photo.time), CAMERA_FRAME),
        format='jpeg' if suffix == 'jpg' else suffix,
        data=array.array('B', photo.read()),
    )


def _states(recording: Recording) -> Iterator[tuple[int, str, Any]]:
    if recording.maps is None:
        return
    maps = recording.maps
    previous = maps.times[0]
    for number, (time, frame) in enumerate(zip(maps.times, maps, strict=True)):
        header = _header(_stamp(time))
        values = np.ascontiguousarray(frame, dtype=np.float32)
        tracer = TracerField(
            header=header,
            grid=grid_to_msg(maps.grid),
            concentration=array.array('f', values.tobytes()),
        )
        state = NewState(
            header=header,
            sequence=number + 1,
            time_step=float(time - previous),
            tracer=tracer,
            noise=math.nan,
            calibrated=True,
        )
        yield _stamp(time), topics.NEW_STATE, state
        yield (
            _stamp(time),
            topics.STATE_REFRESHED,
            StateRefreshed(header=header, sequence=number + 1),
        )
        previous = time
