"""The files of a bag: named by metadata.yaml, present in the folder, or not readable here."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zstandard

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_regular
from porotwin_core.rig.yaml_reader import read_yaml_file
from porotwin_recording.mcap.mcap_writer import CHUNK_SIZE

METADATA = 'metadata.yaml'
"""Description of a rosbag2 folder."""

COMPRESSED = '.zstd'
"""Suffix of a file that `ros2 bag record --compression-mode file` has compressed."""

_OTHERS = ('.db3', f'.db3{COMPRESSED}', '.bag')
"""Suffixes of bags in other formats: SQLite, and ROS 1."""


@dataclass(frozen=True)
class BagFolder:
    """The readable files of a bag.

    Attributes:
        files: MCAP files, in the order of recording; compressed ones end in `COMPRESSED`.
        messages_compressed: whether every message is compressed by zstd.
        remarks: one line for each difference between metadata.yaml and the folder.
    """

    files: list[Path]
    messages_compressed: bool = False
    remarks: tuple[str, ...] = ()


def is_bag(path: Path) -> bool:
    """Return whether `path` is a file or folder of a bag, readable here or not."""
    if path.is_dir():
        own = (path / METADATA).is_file() or bool(mcap_files(path) or _others(path))
        return own or bool(bags_in(path))
    return path.name.endswith(('.mcap', f'.mcap{COMPRESSED}', *_OTHERS))


def bags_in(folder: Path) -> list[Path]:
    """Return the bag folders directly in `folder`, by name."""
    return sorted(
        path for path in folder.iterdir() if path.is_dir() and (path / METADATA).is_file()
    )


def bag_folder(path: Path) -> BagFolder:
    """Return the files of the bag at `path`, or of all bags in the folder `path`.

    All MCAP files of a folder count, whether metadata.yaml names them or not: a killed recorder
    writes none, and a recorder that continues has not written it yet.

    Raises:
        InputError: there is no bag, or one in another format.
    """
    if not path.exists():
        raise InputError(f'{path}: no such bag')
    if not path.is_dir():
        if path.name.endswith(_OTHERS):
            raise InputError(_other_format(path, path))
        return BagFolder([path])
    found = mcap_files(path)
    if not (path / METADATA).is_file():
        if others := _others(path):
            raise InputError(_other_format(path, others[0]))
        if found:
            return BagFolder(found)
        if bags := bags_in(path):
            return _together(path, bags)
        raise InputError(
            f'{path}: not a bag; it has neither {METADATA} nor an .mcap file; '
            './porotwin import makes a bag of an experiment folder'
        )
    try:
        information = metadata_of(path / METADATA)
    except InputError as error:
        if not found:
            raise
        return BagFolder(found, remarks=(f'{error}; all {len(found)} .mcap files are read',))
    return _described(path, information, found)


def _together(path: Path, bags: list[Path]) -> BagFolder:
    """Return the files of several bags, which are read as one.

    Raises:
        InputError: one of them cannot be read, or has its messages compressed.
    """
    parts = [bag_folder(bag) for bag in bags]
    packed = [bag for bag, part in zip(bags, parts, strict=True) if part.messages_compressed]
    if packed:
        raise InputError(f'{packed[0]}: its messages are compressed; {_conversion(packed[0])}')
    remarks = [f'{path}: {len(bags)} bags joined: {", ".join(bag.name for bag in bags)}']
    remarks = remarks if len(bags) > 1 else []
    return BagFolder(
        [file for part in parts for file in part.files],
        remarks=(*remarks, *(remark for part in parts for remark in part.remarks)),
    )


def _described(path: Path, information: dict[str, Any], found: list[Path]) -> BagFolder:
    """Return the files in the folder `path`, compared with its metadata."""
    others = _others(path)
    if not found and others:  # a reindex leaves no name of the format, so the files tell it
        raise InputError(_other_format(path, others[0]))
    mode = str(information.get('compression_mode') or 'none').lower()
    method = str(information.get('compression_format') or 'none').lower()
    if mode != 'none' and method not in ('none', 'zstd'):
        raise InputError(f'{path}: is compressed by {method}; {_conversion(path)}')
    named = [path / Path(str(name)).name for name in information['relative_file_paths']]
    remarks = [
        f"{path}: {METADATA} names '{file.name}', which is not there{_count_in(information, file)}"
        for file in named
        if not file.is_file() and not _is_twin(file, found)
    ]
    there = [file for file in found if file in named or _is_twin(file, named)]
    more = [file for file in found if file not in there]
    if more:
        names = ', '.join(file.name for file in more)
        remarks.append(f'{path}: {names} joined, although {METADATA} does not name it')
    if not there and not more:
        raise InputError(f'{remarks[0] if remarks else path}; there is no .mcap file to read')
    return BagFolder(sorted(there + more, key=_number), mode == 'message', tuple(remarks))


def _is_twin(file: Path, others: list[Path]) -> bool:
    """Return whether `file` is the compressed or unpacked form of one of `others`."""
    return any(
        file.name.removesuffix(COMPRESSED) == o.name.removesuffix(COMPRESSED) for o in others
    )


def _number(file: Path) -> tuple[int, str]:
    """Return the key of the order of recording: bag_9.mcap comes before bag_10.mcap."""
    digits = _stem(file).rpartition('_')[2]
    return int(digits) if digits.isdecimal() else -1, file.name


def bag_of(file: Path) -> Path:
    """Return the folder and name of the bag of a `file`: bag_0.mcap and bag_1.mcap are of one."""
    name, _, digits = _stem(file).rpartition('_')
    return file.with_name(name) if name and digits.isdecimal() else file.with_name(_stem(file))


def _stem(file: Path) -> str:
    return file.name.removesuffix(COMPRESSED).removesuffix('.mcap')


def mcap_files(folder: Path) -> list[Path]:
    """Return the MCAP files in `folder` in the order of recording, compressed ones included."""
    files = [*folder.glob('*.mcap'), *folder.glob(f'*.mcap{COMPRESSED}')]
    plain = {file.name for file in files}
    return sorted(
        (file for file in files if file.name.removesuffix(COMPRESSED) not in plain - {file.name}),
        key=_number,
    )


def _others(folder: Path) -> list[Path]:
    return sorted(file for suffix in _OTHERS for file in folder.glob(f'*{suffix}'))


def _conversion(path: Path) -> str:
    """Return the command that converts a bag, if the library behind it can open the bag."""
    source = path if path.is_dir() or path.suffix == '.bag' else path.parent
    new = path.with_name(f'{path.name.split(".")[0]}_mcap')
    try:
        _open_with_rosbags(source)
    except Exception as error:  # it raises errors of many types
        reason = ' '.join(str(error).split()) or type(error).__name__
        return (
            f'rosbags-convert cannot open it ({reason}); record it again as MCAP, or make its '
            f"{METADATA} anew with 'ros2 bag reindex {shlex.quote(str(source))}'"
        )
    paths = f'--src {shlex.quote(str(source))} --dst {shlex.quote(str(new))}'
    return f"convert it with 'rosbags-convert {paths} --dst-storage mcap'"


def _open_with_rosbags(source: Path) -> None:
    from rosbags import rosbag1, rosbag2

    reader = rosbag1.Reader(source) if source.suffix == '.bag' else rosbag2.Reader(source)
    reader.open()
    reader.close()


def _other_format(path: Path, file: Path) -> str:
    """Return the message about a bag whose `file` is in a format that is not read."""
    kind = 'ROS 1' if file.suffix == '.bag' else 'sqlite3'
    return f'{path}: is a {kind} bag; {_conversion(path)}'


def _count_in(information: dict[str, Any], file: Path) -> str:
    """Return how many messages a missing file held, as far as the metadata say so."""
    for entry in information.get('files') or []:
        if isinstance(entry, dict) and entry.get('path') == file.name:
            return f'; its {entry.get("message_count")} messages are missing'
    return '; its messages are missing'


def metadata_of(path: Path) -> dict[str, Any]:
    """Return the description of a bag in the metadata at `path`.

    Raises:
        InputError: it is not readable.
    """
    try:
        information = read_yaml_file(path, remedy='')['rosbag2_bagfile_information']
        if not isinstance(information['relative_file_paths'], list):
            raise TypeError
    except (OSError, ValueError, LookupError, TypeError):
        raise InputError(f'{path}: not the metadata of a bag; remove or replace it') from None
    assert isinstance(information, dict)
    return information


def unpacked(path: Path, target: Path) -> Path:
    """Unpack the zstd file `path` into `target` and return it, as far as it is intact.

    Raises:
        InputError: nothing can be unpacked, or it is more than is read at once.
    """
    done, fault = 0, 'it ends early'
    try:
        with open_regular(path) as source, target.open('wb') as copy:
            reader = zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)
            while piece := reader.read(CHUNK_SIZE):
                done += copy.write(piece)
                check_declared(path, (done,))
    except zstandard.ZstdError as error:
        fault = str(error)
    except InputError as error:
        raise InputError(
            f'{error}; if you trust the file, unpack it with zstd -d, and name the result'
        ) from None
    except OSError as error:
        raise InputError(f'{path}: cannot be unpacked ({error.strerror})') from None
    if not done:
        raise InputError(f'{path}: cannot be unpacked by zstd ({fault})')
    return target


def is_packed(data: bytes) -> bool:
    """Return whether a message begins as zstd data do; no message in CDR does."""
    return data.startswith(zstandard.FRAME_HEADER)


def plain_data(path: Path, data: bytes) -> bytes:
    """Return a message (CDR) that is compressed by zstd.

    Raises:
        InputError: it is damaged.
    """
    try:
        plain = bytearray()
        with zstandard.ZstdDecompressor().stream_reader(data) as reader:
            while piece := reader.read(CHUNK_SIZE):
                plain += piece
                check_declared('it', (len(plain),))
        return bytes(plain)
    except (zstandard.ZstdError, MemoryError, InputError) as error:
        raise InputError(f'{path}: a compressed message is damaged: {error}') from None
