"""Tensor files: read back, and refused if they are something else."""

from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy

from porotwin_core.basis.errors import InputError
from porotwin_costa.data.tensor_files import read_tensors, write_tensors


def test_a_file_whose_length_looks_like_a_pickle_is_read(tmp_path):
    for length in range(300):
        path = tmp_path / f'{length}.safetensors'
        write_tensors(path, {'value': np.zeros(1)}, 'test', {'text': 'x' * length})
        assert read_tensors(path, 'test')[0]['text'] == 'x' * length
    starts = {path.read_bytes()[:1] for path in tmp_path.iterdir()}
    assert b'\x80' in starts


def test_tensors_and_description_are_read_back(tmp_path):
    path = tmp_path / 'deep' / 'file.safetensors'
    write_tensors(path, {'value': np.arange(6.0).reshape(2, 3)[:, ::2]}, 'test-1', {'a': [1, 'b']})
    description, values = read_tensors(path, 'test-1')
    assert description == {'a': [1, 'b']}
    assert values['value'].tolist() == [[0.0, 2.0], [3.0, 5.0]]
    assert [file.name for file in path.parent.iterdir()] == ['file.safetensors']


def test_another_format_is_refused(tmp_path):
    path = tmp_path / 'file.safetensors'
    write_tensors(path, {'value': np.zeros(1)}, 'test-1', {})
    with pytest.raises(InputError, match='made as test-1, needs test-2'):
        read_tensors(path, 'test-2')


def test_a_full_disk_and_an_empty_path_are_told_in_one_line(tmp_path, monkeypatch):
    def full(*_):
        raise safetensors.SafetensorError('I/O error: No space left on device (os error 28)')

    with pytest.raises(InputError, match='cannot be written'):
        write_tensors(Path(), {'value': np.zeros(1)}, 'test', {})
    monkeypatch.setattr(safetensors.numpy, 'save_file', full)
    with pytest.raises(InputError, match='No space left on device'):
        write_tensors(tmp_path / 'file.safetensors', {'value': np.zeros(1)}, 'test', {})
    assert not list(tmp_path.iterdir())
