"""Tests that an output has one writer."""

from pathlib import Path

import pytest

from porotwin_core.errors import InputError
from porotwin_recording.one_writer import one_writer


def test_a_second_writer_of_an_output_is_refused(tmp_path: Path) -> None:
    target = tmp_path / 'new' / 'experiment'
    with one_writer(target):
        with (
            pytest.raises(InputError, match='is being written by another call'),
            one_writer(target),
        ):
            pass
        with one_writer(tmp_path / 'new' / 'other'):
            pass
    with one_writer(target):
        target.mkdir()
    assert list(target.parent.iterdir()) == [target]
    with pytest.raises(InputError, match='exists already'), one_writer(target):
        pass
