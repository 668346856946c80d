"""Text files that are written completely or not at all."""

from pathlib import Path

import pytest

from porotwin_core.basis.whole_file import write_whole


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
