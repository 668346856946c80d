"""A catalogue of recordings, from their indexes and a few of their messages.

Photographs and maps are not read, but for the head of a photograph in a folder, so that hundreds of
bags of 100 GB take seconds. An entry needs the index of a bag, the chunk with the rig, and the
chunks with a first and a last message.
"""

import contextlib
import itertools
import os
import re
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.stamps import SAME_MOMENT_S, SINCE_1970
from porotwin_recording.experiment.experiment_folder import (
    FILES,
    RIG_FILE,
    folder_data,
    is_experiment,
    is_unfinished,
)
from porotwin_recording.experiment.known_verdicts import KnownVerdicts
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.bag_folder import (
    COMPRESSED,
    METADATA,
    BagFolder,
    bag_folder,
    metadata_of,
)
from porotwin_recording.mcap.mcap_summary import McapSummary, summary_of
from porotwin_recording.mcap.serialization import SECOND
from porotwin_recording.tables.concentration import is_of_virtual_rig
from porotwin_recording.tables.recorded_data import RecordedData
from porotwin_recording.tables.recording_date import date_of_files

BEING_WRITTEN_S = 30.0
"""A file without an end that changed within this time is being recorded [s]."""

PHOTOGRAPHS = 'photos'
NO_VERDICTS = KnownVerdicts()
MODEL_EFFECTS = 'porotwin_msgs/msg/ModelEffects'
LOG = 'rosout'
CHUNKS_OF_LOG = 16
"""Number of chunks that are searched for the first lines of all nodes."""

NETWORK_LINE = re.compile(r'\w+ network on \d+x\d+, .*')
"""Line that the node costa logs about its network."""


@dataclass(frozen=True)
class CatalogueEntry:
    """One recording.

    Attributes:
        path: the bag or experiment folder.
        kind: `bag` or `folder`.
        state: `complete`, of a bag by the index at its end: damage before that shows when it is
            read; `truncated` (no end, or files are missing), `recording` (no end yet),
            `unfinished` (a folder whose maps are not complete), `compressed` (its files are read
            only as a whole) or `unreadable`.
        size_bytes: size of its files.
        start: when it began, in UTC; None: it does not say.
        files_date: earliest change of its files, in UTC; copies may be younger. None: unreadable.
        duration_s: from its first to its last message, map, photograph or rate [s].
        rig: name of the rig; empty: not known.
        width_m: width of the rig [m]; 0: not known.
        height_m: height of the rig [m].
        photographs: number of photographs without baselines.
        maps: number of concentration maps.
        setpoints: number of setpoints or changes of the commanded rates.
        files: number of files of a bag that is split.
        effects: effects in force at its end, the rig's own included.
        diagnosed: verdict of the newest diagnosis of it; empty: there is none.
        costa: the network that corrected its forecasts; empty: none.
        calibration: SHA-256 of the calibration of its maps; empty: none, or not known.
        remarks: faults, one line each.
        virtual: whether the virtual rig made its maps, or took its photographs. A live bag tells it
            in its photographs only, which are not read here.
    """

    path: Path
    kind: str
    state: str = 'complete'
    size_bytes: int = 0
    start: datetime | None = None
    duration_s: float = 0.0
    rig: str = ''
    width_m: float = 0.0
    height_m: float = 0.0
    photographs: int = 0
    maps: int = 0
    setpoints: int = 0
    files: int = 1
    effects: tuple[str, ...] = ()
    diagnosed: str = ''
    costa: str = ''
    calibration: str = ''
    remarks: tuple[str, ...] = field(default=())
    files_date: datetime | None = None
    virtual: bool = False

    @property
    def date(self) -> datetime | None:
        """When it began, or else the date of its files, in UTC; None: not known."""
        return self.start or self.files_date


def find_recordings(root: Path) -> Iterator[Path]:
    """Yield every bag and experiment folder in the folder `root`, or `root` itself, by name.

    A folder is one bag if it has a metadata.yaml, or if its files are named as a recorder names
    the parts of one bag, and it has no rig.yaml. Other .mcap files are bags of their own.

    Raises:
        InputError: there is no such folder, or a file is no bag.
    """
    if not root.exists():
        raise InputError(f'{root}: no such folder; name one with recordings')
    if root.is_file():
        if not root.name.endswith(('.mcap', f'.mcap{COMPRESSED}')):
            raise InputError(f'{root}: is no recording; name a folder with recordings, or a bag')
        yield root
        return
    for place, folders, names in os.walk(root):
        folder = Path(place)
        folders.sort()
        files = sorted(name for name in names if name.endswith(('.mcap', f'.mcap{COMPRESSED}')))
        if RIG_FILE in names and not {*FILES[1:]}.isdisjoint(names):
            yield folder
            folders[:] = [name for name in folders if name != PHOTOGRAPHS]
        is_split = files and all(_is_part(name, folder) for name in files)
        if RIG_FILE not in names and (METADATA in names or is_split):
            yield folder
        else:
            yield from (folder / name for name in files)


def without_copies(entries: Iterable[CatalogueEntry]) -> list[CatalogueEntry]:
    """Return `entries` without bags of the experiment whose tables lie in the same folder.

    Such a folder is read by its tables, and tells its bag in a remark.
    """
    found = list(entries)
    folders = {entry.path: entry for entry in found if entry.kind == 'folder'}
    for bag in [entry for entry in found if entry.kind == 'bag']:
        folder = folders.get(bag.path.parent)
        if folder is not None and _same_experiment(folder, bag):
            found.remove(bag)
            line = f'{folder.path}: {bag.path.name} holds the same experiment; the tables are read'
            found[found.index(folder)] = replace(folder, remarks=(*folder.remarks, line))
    return found


def _same_experiment(one: CatalogueEntry, other: CatalogueEntry) -> bool:
    both = ((entry.rig, entry.photographs, entry.maps) for entry in (one, other))
    return len(set(both)) == 1 and abs(one.duration_s - other.duration_s) < SAME_MOMENT_S


def _is_part(name: str, folder: Path) -> bool:
    stem, _, number = name.removesuffix(COMPRESSED).removesuffix('.mcap').rpartition('_')
    return stem == folder.resolve().name and number.isdecimal()


def catalogue_entry(path: Path, verdicts: KnownVerdicts = NO_VERDICTS) -> CatalogueEntry:
    """Return the entry of the recording at `path`; one that cannot be read has the fault in it."""
    is_folder = is_experiment(path)
    try:
        entry = _folder_entry(path) if is_folder else _bag_entry(path)
        return replace(
            entry, diagnosed=verdicts.of(path), files_date=date_of_files(path).astimezone(UTC)
        )
    except (InputError, OSError) as error:
        reason = error.strerror or str(error) if isinstance(error, OSError) else str(error)
        line = ' '.join(reason.split())
        line = line if str(path) in line else f'{path}: {line}'
        kind = 'folder' if is_folder else 'bag'
        return CatalogueEntry(path, kind, 'unreadable', _size_of([path]), remarks=(line,))


def _size_of(paths: Iterable[Path]) -> int:
    """Return the size of files [bytes]; those that are not there count nothing."""
    total = 0
    for path in paths:
        with contextlib.suppress(OSError):
            total += path.stat().st_size if path.is_file() else 0
    return total


# --- experiment folders -------------------------------------------------------------------------


def _folder_entry(path: Path) -> CatalogueEntry:
    data = folder_data(path)
    files = [path / name for name in FILES]
    files += [photo.path for photo in data.photos if photo.path is not None]
    origin = data.maps.origin if data.maps is not None else None
    return CatalogueEntry(
        path,
        'folder',
        'unfinished' if is_unfinished(path) else 'complete',
        size_bytes=_size_of(files),
        duration_s=_duration(data),
        rig=data.rig.name,
        width_m=data.rig.width_m,
        height_m=data.rig.height_m,
        photographs=sum(photo.role == 'state' for photo in data.photos),
        maps=len(data.maps) if data.maps is not None else 0,
        setpoints=len({row.time for row in data.commanded.rows}) if data.commanded else 0,
        effects=tuple(effect.name for effect in data.rig.effects),
        calibration=origin.calibration if origin else '',
        remarks=tuple(f'{path}: {text}' for text in data.remarks),
        virtual=data.is_virtual,
    )


def _duration(data: RecordedData) -> float:
    first_map = () if data.maps is None else data.maps.times[:1]
    return data.end - min([0.0, *first_map, *(photo.time for photo in data.photos)])


# --- bags ---------------------------------------------------------------------------------------


def _bag_entry(path: Path) -> CatalogueEntry:
    folder = bag_folder(path)
    size = _size_of(folder.files)
    remarks = [*folder.remarks]
    if folder.messages_compressed or all(file.name.endswith(COMPRESSED) for file in folder.files):
        return _described_entry(path, folder, size)
    summaries = []
    for file in folder.files:
        try:
            summaries.append(summary_of(file))
        except InputError as error:
            remarks.append(str(error))
    if not summaries:
        raise InputError(remarks[-1])
    remarks += [f'{part.path}: has no end' for part in summaries if not part.complete]
    filled = [part for part in summaries if part.statistics.message_count]
    first = min((part.statistics.message_start_time for part in filled), default=0)
    last = max((part.statistics.message_end_time for part in filled), default=0)
    rig = _message(filled, topic_names.RIG)
    state = _message(filled, topic_names.NEW_STATE)
    return CatalogueEntry(
        path,
        'bag',
        _bag_state(summaries, remarks),
        size,
        _moment(first),
        (last - first) / SECOND,
        str(rig.name) if rig else '',
        float(rig.width) if rig else 0.0,
        float(rig.height) if rig else 0.0,
        **_counts(filled),
        files=len(folder.files),
        effects=_effects(filled, rig),
        costa=_costa(filled),
        calibration=str(getattr(state, 'calibration', '')),
        remarks=tuple(remarks),
        virtual=any(map(is_of_virtual_rig, itertools.chain(*(p.programs() for p in filled)))),
    )


def _bag_state(parts: Sequence[McapSummary], remarks: Sequence[str]) -> str:
    if not remarks:
        return 'complete'
    open_files = [part.path for part in parts if not part.complete]
    now = time.time()
    growing = any(now - path.stat().st_mtime < BEING_WRITTEN_S for path in open_files)
    return 'recording' if growing else 'truncated'


def _described_entry(path: Path, folder: BagFolder, size: int) -> CatalogueEntry:
    """Return the entry of a compressed bag, from its metadata.yaml."""
    described = metadata_of(path / METADATA) if path.is_dir() else {}
    try:
        counts = {
            str(entry['topic_metadata']['name']): int(entry['message_count'])
            for entry in described.get('topics_with_message_count', [])
        }
        start = int(described['starting_time']['nanoseconds_since_epoch'])
        duration_s = int(described['duration']['nanoseconds']) / SECOND
    except (LookupError, TypeError, ValueError):
        counts, start, duration_s = {}, 0, 0.0

    def count(topic: str) -> int:
        return sum(counts[name] for name in counts if name.endswith(f'/{topic}'))

    return CatalogueEntry(
        path,
        'bag',
        'compressed',
        size,
        _moment(start),
        duration_s,
        photographs=count(topic_names.IMAGE),
        maps=count(topic_names.NEW_STATE),
        setpoints=count(topic_names.SETPOINT),
        files=len(folder.files),
        remarks=folder.remarks,
    )


def _counts(parts: Sequence[McapSummary]) -> dict[str, Any]:
    topics = {
        'photographs': topic_names.IMAGE,
        'maps': topic_names.NEW_STATE,
        'setpoints': topic_names.SETPOINT,
    }
    return {name: sum(part.count(topic) for part in parts) for name, topic in topics.items()}


def _moment(stamp: int) -> datetime | None:
    """Return the time of a stamp [ns]; None if it is no time of day, as the first of an import."""
    return datetime.fromtimestamp(stamp / SECOND, UTC) if stamp > SINCE_1970 * SECOND else None


def _message(
    parts: Sequence[McapSummary], topic: str = '', *, type_name: str = '', last: bool = False
) -> Any:
    """Return the first or last message on a topic or of a type; None: there is none."""
    for part in reversed(parts) if last else parts:
        numbers = part.numbers(topic, type_name=type_name)
        if numbers:
            for message in part.messages(numbers, last=last):
                return message
    return None


def _effects(parts: Sequence[McapSummary], rig: Any) -> tuple[str, ...]:
    """Return the effects of the rig and those that the model had at the end."""
    mended = _message(parts, type_name=MODEL_EFFECTS, last=True)
    both = [*getattr(rig, 'effects', ()), *getattr(mended, 'effects', ())]
    return tuple(dict.fromkeys(str(effect.name) for effect in both))


def _costa(parts: Sequence[McapSummary]) -> str:
    """Return the network as the node costa described it at its start, if it corrected forecasts."""
    report = _message(parts, topic_names.CYCLE, last=True)
    if report is None or not report.corrected:
        return ''
    for part in parts:
        for line in part.messages(part.numbers(LOG), chunks=CHUNKS_OF_LOG):
            if str(line.name).endswith('costa') and NETWORK_LINE.fullmatch(str(line.msg)):
                return str(line.msg)
    return 'a network that the bag does not name'
