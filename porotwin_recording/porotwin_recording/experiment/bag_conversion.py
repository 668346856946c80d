"""Converts an experiment folder to a bag, and a bag to an experiment folder.

Exact in both directions: tracer maps as float32, photographs byte for byte, times to the
nanosecond, every change of a rate, and the rig with its maps. Packed maps become float32 with the
same values. Photographs get names from role and number; a map file of the rig gets its name from
the quantity. The folder of a live bag holds the experiment only, without predictions, reports and
diagnostics.
"""

import array
import heapq
import logging
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError, write_error
from porotwin_core.basis.whole_folder import whole_folder
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.ros.conversions import (
    CAMERA_FRAME,
    RIG_FRAME,
    duration_to_msg,
    grid_to_msg,
    map_to_msg,
    rates_to_msg,
    rig_to_msg,
    stamp_to_msg,
)
from porotwin_msgs.msg import (
    CleanState,
    NewState,
    Setpoint,
    StateRefreshed,
    TracerField,
    WellRates,
)
from porotwin_recording.experiment.bag import IMPORTED
from porotwin_recording.experiment.cut import cut
from porotwin_recording.experiment.experiment_folder import READINGS_FILE, Progress, write_folder
from porotwin_recording.experiment.photo_source import content_mark
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.experiment.segments import SINCE_1970_NS
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import TopicQos
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.serialization import SECOND, Serializer, message_type
from porotwin_recording.tables.concentration import VIRTUAL
from porotwin_recording.tables.one_writer import one_writer
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData

LOG = logging.getLogger('porotwin')
"""Receives a warning for what a bag cannot hold."""

IMPORT_START = SINCE_1970_NS
"""Start of every imported experiment [ns], 2001-09-09 01:46:40 UTC; equal folders, equal bags."""

_QOS = {
    topic_names.RIG: TopicQos(depth=1, durability='transient_local'),
    topic_names.BASELINE: TopicQos(durability='transient_local'),
    topic_names.SETPOINT: TopicQos(depth=1),
}

_EXPORTED = tuple(
    f'/{name}'
    for name in (
        topic_names.RIG,
        topic_names.SETPOINT,
        topic_names.MEASURED,
        topic_names.NEW_STATE,
        topic_names.STATE_REFRESHED,
        topic_names.CLEAN_STATE,
        topic_names.IMAGE,
        topic_names.BASELINE,
    )
)
"""Topics whose content is in an experiment folder."""

_COUNTED = (topic_names.NEW_STATE, topic_names.IMAGE, topic_names.BASELINE)
"""Topics whose messages count as progress."""


class _StampedMessage(NamedTuple):
    """A message, its stamp [ns], and its topic relative to the namespace."""

    stamp: int
    topic: str
    message: Any


def import_experiment(
    folder: Path | str, bag: Path | str, *, progress: Progress | None = None
) -> None:
    """Write the experiment in `folder` as a bag, as if it had been recorded live.

    The bag appears when it is complete, and not at all after an error.

    Args:
        folder: the experiment folder.
        bag: the new bag, a folder or a file .mcap.
        progress: receives the number of finished maps and photographs, and their total.

    Raises:
        InputError: one line that names a fault in the folder, or the bag exists.
    """
    recording = open_recording(folder)
    if recording.readings:
        LOG.warning(
            '%s: a bag holds no readings; keep %s beside it, and copy it into a folder that export '
            'makes of the bag',
            folder,
            READINGS_FILE,
        )
    serializer = Serializer()
    counts: dict[str, int] = {}
    total = len(recording.photos) + (len(recording.maps) if recording.maps else 0)
    done = 0
    target = Path(bag)
    with (
        one_writer(target),
        _told_of(target),
        whole_folder(target, named=True) as path,
        BagWriter(path) as writer,
    ):
        for stamp, topic, message in _messages(recording):
            name = f'{topic_names.NAMESPACE}/{topic}'
            program = PROGRAM
            if topic == topic_names.NEW_STATE and recording.maps is not None:
                program = recording.maps.origin.program
            elif topic in (topic_names.IMAGE, topic_names.BASELINE) and recording.is_virtual:
                program = f'{PROGRAM}, {VIRTUAL}'
            writer.add_topic(
                name,
                message_type(message),
                qos=_QOS.get(topic),
                program=program,
            )
            counts[name] = counts.get(name, 0) + 1
            writer.write(name, serializer.to_cdr(message), log_time=stamp, sequence=counts[name])
            if progress and topic in _COUNTED:
                done += 1
                progress(done, total)


def topics_left_out(bag: Path | str) -> dict[str, int]:
    """Return the topics that an export leaves out, with the numbers of their messages.

    Raises:
        InputError: the bag cannot be read.
    """
    topics = BagReader(bag).topics
    return {
        name: topic.message_count
        for name, topic in sorted(topics.items())
        if topic.message_count and not name.endswith(_EXPORTED)
    }


def export_bag(
    bag: Path | str,
    folder: Path | str,
    *,
    segment: int | None = None,
    times: tuple[float, float] | None = None,
    progress: Progress | None = None,
) -> None:
    """Write the experiment in `bag`, or a part of it, as an experiment folder.

    The folder appears when it is complete, and not at all after an error. After a kill or an
    interrupt the same call goes on; photographs that are there already are not read again.

    Args:
        bag: the bag, a folder or a file .mcap; an experiment folder too.
        folder: the new experiment folder.
        segment: which experiment of the bag, from 1; None: the longest.
        times: first and last time of the maps and photographs [s] (`cut`); None: all of them.
        progress: receives the number of finished maps and photographs, and their total.

    Raises:
        InputError: one line that names a fault in the bag, or the folder exists.
    """
    recording = open_recording(bag, segment=segment)
    if times is not None:
        recording = cut(recording, *times)
    source = (
        f'{recording.source.resolve()}, segment {segment}, times {times}, {content_mark(recording)}'
    )
    with _kept_after_interrupt(Path(folder), source) as path:
        write_folder(path, recording, progress=progress)


@contextmanager
def _kept_after_interrupt(target: Path, source: str) -> Iterator[Path]:
    """Yield a folder that is renamed to `target` at the end, or removed after an error.

    A kill or an interrupt leaves it. It is yielded again, with its photographs, if `source` is the
    same.
    """
    with one_writer(target), _told_of(target), whole_folder(target, source=source) as path:
        for file in path.iterdir():
            if file.is_file():
                file.unlink()
        yield path


@contextmanager
def _told_of(target: Path) -> Iterator[None]:
    """Raise faults of the disk as faults of `target`, but not those of other files."""
    try:
        yield
    except OSError as error:
        begun = str(target.with_name(f'.{target.name}'))
        if error.errno is None or not str(error.filename or begun).startswith(begun):
            raise
        raise write_error(target, error) from None


def _messages(data: RecordedData) -> Iterator[_StampedMessage]:
    """Yield all messages of an experiment, ordered by stamp."""
    streams = [_opening(data), _setpoints(data), _measured(data), _images(data), _states(data)]
    yield from heapq.merge(*streams, key=lambda item: item.stamp)


def _stamp(time: float) -> int:
    return IMPORT_START + round(time * SECOND)


def _header(stamp: int, frame: str = RIG_FRAME) -> Header:
    return Header(stamp=stamp_to_msg(stamp), frame_id=frame)


def _opening(data: RecordedData) -> Iterator[_StampedMessage]:
    first_map = 0.0 if data.maps is None else min(0.0, float(data.maps.times[0]))
    first = min([first_map, *(photo.time for photo in data.photos)])
    yield _StampedMessage(_stamp(first), topic_names.RIG, rig_to_msg(data.rig))
    start = CleanState(header=_header(IMPORT_START), cause=CleanState.START, reason=IMPORTED)
    # behind a map it would begin another sequence
    yield _StampedMessage(_stamp(first_map), topic_names.CLEAN_STATE, start)


def _changes(schedule: Schedule) -> Iterator[tuple[float, dict[str, WellRate]]]:
    """Yield the rates of all wells at the time of every change, changed wells first."""
    for time in dict.fromkeys(row.time for row in schedule.rows):
        rates = schedule.at(time)
        changed = [row.well for row in schedule.rows if row.time == time]
        yield time, {well: rates[well] for well in dict.fromkeys((*changed, *rates))}


def _setpoints(data: RecordedData) -> Iterator[_StampedMessage]:
    if data.commanded is None:
        return
    times = [row.time for row in data.commanded.rows]
    times += [] if data.maps is None else [data.maps.times[-1]]
    end = max([*times, *(photo.time for photo in data.photos)], default=0.0)
    changes = list(_changes(data.commanded))
    ends = [*(time for time, _ in changes[1:]), end]
    for number, ((time, rates), until) in enumerate(zip(changes, ends, strict=False)):
        message = Setpoint(
            header=_header(_stamp(time)),
            sequence=number + 1,
            valid_until=stamp_to_msg(_stamp(until)),
            wells=rates_to_msg(rates),
            reason='imported',
        )
        yield _StampedMessage(_stamp(time), topic_names.SETPOINT, message)


def _measured(data: RecordedData) -> Iterator[_StampedMessage]:
    if data.measured is None:
        return
    for time, rates in _changes(data.measured):
        stamp = _stamp(time)
        message = WellRates(
            header=_header(stamp), start=stamp_to_msg(stamp), wells=rates_to_msg(rates)
        )
        yield _StampedMessage(stamp, topic_names.MEASURED, message)


def _images(data: RecordedData) -> Iterator[_StampedMessage]:
    for photo in data.photos:
        if photo.role == 'dilution':
            raise InputError(
                f"photograph '{photo.name}' is a dilution, for which a bag has no place; calibrate "
                'from the folder, and import it without its dilutions'
            )
        topic = topic_names.BASELINE if photo.role == 'baseline' else topic_names.IMAGE
        yield _StampedMessage(_stamp(photo.time), topic, _image(photo))


def _image(photo: Photo) -> CompressedImage:
    suffix = Path(photo.name).suffix.lower().lstrip('.')
    return CompressedImage(
        header=_header(_stamp(photo.time), CAMERA_FRAME),
        format='jpeg' if suffix == 'jpg' else suffix,
        data=array.array('B', photo.read()),
    )


def _states(data: RecordedData) -> Iterator[_StampedMessage]:
    if data.maps is None:
        return
    grid, origin = grid_to_msg(data.maps.grid), data.maps.origin
    previous = data.maps.times[0]
    frames = zip(data.maps.times, data.maps.with_deviations(), strict=True)
    for sequence, (time, (frame, deviation, systematic)) in enumerate(frames, start=1):
        stamp = _stamp(time)
        header = _header(stamp)
        state = NewState(
            header=header,
            sequence=sequence,
            time_step=duration_to_msg(time - previous),
            tracer=TracerField(header=header, grid=grid, concentration=map_to_msg(frame)),
            noise=math.nan,
            deviation=map_to_msg(deviation),
            systematic=map_to_msg(systematic),
            calibrated=origin.calibrated is not False,
            calibration=origin.calibration,
        )
        yield _StampedMessage(stamp, topic_names.NEW_STATE, state)
        refreshed = StateRefreshed(header=header, sequence=sequence)
        yield _StampedMessage(stamp, topic_names.STATE_REFRESHED, refreshed)
        previous = time
