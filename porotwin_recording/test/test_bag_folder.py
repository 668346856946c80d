"""Tests of the files of a bag: several, missing, compressed, and of other formats."""

import shlex
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml
import zstandard
from bag_examples import write_setpoints
from recording_examples import STRING
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.mcap.bag_folder import METADATA, is_bag, unpacked
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_writer import BagWriter


def write_parts(folder: Path, count: int = 3) -> Path:
    """Write a rosbag2 folder with `count` files, ten messages in each."""
    for part in range(count):
        with BagWriter(folder, extend=True) as bag:
            bag.add_topic('/words', STRING)
            for number in range(10):
                bag.write('/words', b'%d' % number, log_time=10 * part + number)
    return folder


def change_metadata(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    metadata = yaml.safe_load((folder / METADATA).read_text())
    change(metadata['rosbag2_bagfile_information'])
    (folder / METADATA).write_text(yaml.safe_dump(metadata))


def times(folder: Path) -> list[int]:
    return [message.log_time for message in BagReader(folder).messages()]


def test_all_files_of_a_folder_are_one_bag(tmp_path: Path) -> None:
    bag = BagReader(write_parts(tmp_path / 'run', count=11))
    assert [message.log_time for message in bag.messages()] == list(range(110))
    assert bag.remarks == []
    assert bag.message_count == bag.topics['/words'].message_count == 110


def test_a_missing_file_costs_its_messages(tmp_path: Path) -> None:
    folder = write_parts(tmp_path / 'run')
    (folder / 'run_1.mcap').unlink()
    bag = BagReader(folder)
    assert [message.log_time for message in bag.messages()] == [*range(10), *range(20, 30)]
    (remark,) = bag.remarks
    assert "names 'run_1.mcap', which is not there; its 10 messages are missing" in remark


def test_a_file_of_something_else_costs_its_messages(tmp_path: Path) -> None:
    folder = write_parts(tmp_path / 'run')
    (folder / 'run_2.mcap').write_bytes(b'nothing')
    bag = BagReader(folder)
    assert [message.log_time for message in bag.messages()] == list(range(20))
    assert 'not an MCAP file' in bag.remarks[0]


@pytest.mark.parametrize(
    'text', ['nothing: here', '[', '- ' * 5000, 'rosbag2_bagfile_information: 3', '\x00', '']
)
def test_wrong_metadata_are_no_loss(tmp_path: Path, text: str) -> None:
    folder = write_parts(tmp_path / 'run')
    (folder / METADATA).write_text(text)
    bag = BagReader(folder)
    assert [message.log_time for message in bag.messages()] == list(range(30))
    assert 'not the metadata of a bag' in bag.remarks[0]


def test_a_file_that_the_metadata_do_not_name_is_joined(tmp_path: Path) -> None:
    folder = write_parts(tmp_path / 'run')
    change_metadata(folder, lambda found: found['relative_file_paths'].pop())
    bag = BagReader(folder)
    assert [message.log_time for message in bag.messages()] == list(range(30))
    assert 'run_2.mcap joined' in bag.remarks[0]
    (folder / METADATA).unlink()
    assert times(folder) == list(range(30))


def test_a_folder_in_which_no_file_is_left_is_named(tmp_path: Path) -> None:
    folder = write_parts(tmp_path / 'run', count=1)
    (folder / 'run_0.mcap').unlink()
    with pytest.raises(InputError, match=r"names 'run_0.mcap', which is not there"):
        BagReader(folder)


def test_files_compressed_by_ros2_bag_are_read(tmp_path: Path) -> None:
    folder = write_parts(tmp_path / 'run', count=2)
    for file in folder.glob('*.mcap'):
        packed = zstandard.ZstdCompressor().compress(file.read_bytes())
        file.with_name(f'{file.name}.zstd').write_bytes(packed)
        file.unlink()

    def compressed(found: dict[str, Any]) -> None:
        found.update(compression_mode='FILE', compression_format='zstd')
        found['relative_file_paths'] = [f'{name}.zstd' for name in found['relative_file_paths']]

    change_metadata(folder, compressed)
    assert times(folder) == list(range(20))
    assert is_bag(folder)
    (folder / METADATA).unlink()
    assert times(folder) == list(range(20))
    file = folder / 'run_1.mcap.zstd'
    file.write_bytes(file.read_bytes()[:-20])
    bag = BagReader(folder)
    assert list(bag.messages())
    assert f'{file}: cannot be unpacked by zstd' in bag.remarks[0]


def test_a_compressed_file_does_not_fill_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / 'run.mcap.zstd'
    file.write_bytes(zstandard.ZstdCompressor().compress(bytes(100 << 20)))
    monkeypatch.setattr(
        'porotwin_recording.mcap.bag_folder.check_declared', partial(check_declared, most=3 << 20)
    )
    with pytest.raises(InputError) as refused:
        unpacked(file, tmp_path / 'plain.mcap')
    assert str(refused.value).startswith(f'{file}: claims ')
    assert 'unpack it with zstd -d' in str(refused.value)
    assert (tmp_path / 'plain.mcap').stat().st_size <= 4 << 20


def test_messages_compressed_by_ros2_bag_are_read(tmp_path: Path) -> None:
    packed = zstandard.ZstdCompressor().compress(b'hello')
    with BagWriter(tmp_path / 'run', compress=False) as bag:
        bag.add_topic('/words', STRING)
        bag.write('/words', packed, log_time=1)
        bag.write('/words', b'no zstd', log_time=2)
    change_metadata(
        tmp_path / 'run',
        lambda found: found.update(compression_mode='MESSAGE', compression_format='zstd'),
    )
    messages = BagReader(tmp_path / 'run').messages()
    assert next(messages).data == b'hello'
    with pytest.raises(InputError, match='a compressed message is damaged'):
        next(messages)


def test_a_sqlite_bag_is_converted_by_the_command_of_the_message(tmp_path: Path) -> None:
    folder = tmp_path / 'my run'
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        connection = bag.add_connection('/words', 'std_msgs/msg/String', typestore=store)
        word = store.types['std_msgs/msg/String']('word')
        bag.write(connection, 7, store.serialize_cdr(word, 'std_msgs/msg/String'))
    for path in (folder, next(folder.glob('*.db3'))):
        with pytest.raises(InputError, match='is a sqlite3 bag; convert it with') as error:
            open_recording(path)
        command = shlex.split(str(error.value).split("'rosbags-convert")[1].removesuffix("'"))
        subprocess.run([Path(sys.executable).parent / 'rosbags-convert', *command], check=True)
        made = Path(command[command.index('--dst') + 1])
        assert times(made) == [7]


@pytest.mark.parametrize('name', ['run.bag', 'run.db3', 'run.db3.zstd', 'folder/run_0.db3'])
def test_no_command_is_proposed_that_cannot_open_the_bag(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(b'SQLite format 3\0')
    path = file.parent if name.startswith('folder') else file
    with pytest.raises(InputError, match='bag; rosbags-convert cannot open it'):
        open_recording(path)


def test_the_files_tell_the_storage_where_a_reindex_names_none(tmp_path: Path) -> None:
    folder = write_parts(tmp_path / 'run')
    change_metadata(
        folder,
        lambda found: found.update(
            storage_identifier='', compression_format='', compression_mode='', files=[]
        ),
    )
    bag = BagReader(folder)
    assert bag.message_count == 30
    assert bag.remarks == []


def test_a_file_unpacked_by_hand_is_not_missing(tmp_path: Path) -> None:
    folder = write_parts(tmp_path / 'run')
    names = [f'run/run_{number}.mcap.zstd' for number in range(3)]
    change_metadata(folder, lambda found: found.update(relative_file_paths=names))
    bag = BagReader(folder)
    assert bag.message_count == 30
    assert bag.remarks == []


def test_packed_messages_are_read_though_the_metadata_are_lost(tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'run') as bag:
        bag.add_topic('/words', STRING)
        for time in range(3):
            bag.write('/words', zstandard.compress(b'\0\1\0\0word'), log_time=time)
    (tmp_path / 'run' / METADATA).unlink()
    assert [m.data for m in BagReader(tmp_path / 'run').messages()] == [b'\0\1\0\0word'] * 3


def test_an_unknown_compression_is_named(tmp_path: Path) -> None:
    write_setpoints(tmp_path / 'run')
    change_metadata(
        tmp_path / 'run',
        lambda found: found.update(compression_mode='file', compression_format='lzma'),
    )
    with pytest.raises(InputError, match='is compressed by lzma; '):
        BagReader(tmp_path / 'run')
