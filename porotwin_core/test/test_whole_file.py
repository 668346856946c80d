"""Text files that are written completely or not at all."""

import threading
from pathlib import Path

import pytest

from porotwin_core.basis.whole_file import whole_file, write_whole


def test_a_failed_write_leaves_the_file_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / 'hashes.json'
    write_whole(path, 'first')

    def full(*_args, **_options):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(Path, 'write_text', full)
    with pytest.raises(OSError, match='no space left'):
        write_whole(path, 'second')
    assert path.read_text() == 'first'
    assert [file.name for file in tmp_path.iterdir()] == ['hashes.json']


def test_two_threads_that_write_one_file_never_mix(tmp_path):
    path, both_write = tmp_path / 'model', threading.Barrier(2)

    def write(letter: str) -> None:
        with whole_file(path) as unfinished:
            unfinished.write_text(letter)
            both_write.wait()
            assert unfinished.read_text() == letter
            both_write.wait()

    other = threading.Thread(target=write, args=['a'], daemon=True)
    other.start()
    write('b')
    other.join()
    assert path.read_text() in ('a', 'b')
    assert [file.name for file in tmp_path.iterdir()] == ['model']
