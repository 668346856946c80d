"""Tensor files that cannot run code: safetensors with one JSON object in the header."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError, write_error
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.whole_file import whole_file

_PICKLES = (b'\x80', b'PK\x03\x04')
"""First bytes of Python pickles and of torch.save archives."""

_KEY = 'porotwin'
"""Name of the header entry that holds the JSON object."""


def write_tensors(
    path: Path, tensors: Mapping[str, NDArray], file_format: str, description: Mapping[str, Any]
) -> None:
    """Write tensors and their description to `path`: the whole file or nothing.

    Args:
        path: the file; missing folders are made.
        tensors: arrays by name.
        file_format: name of the format, checked by `read_tensors`.
        description: JSON values for the header.

    Raises:
        InputError: the file cannot be written.
    """
    # one entry only: safetensors writes several entries in random order
    metadata = {_KEY: json.dumps({'format': file_format, **description})}
    contiguous = {name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as unfinished:
            safetensors.numpy.save_file(contiguous, unfinished, metadata)
    except (OSError, ValueError, safetensors.SafetensorError) as error:  # the last: a full disk
        raise InputError(str(write_error(path, error))) from None


def read_tensors(path: Path, file_format: str) -> tuple[dict[str, Any], dict[str, NDArray]]:
    """Return the JSON description in `path`, and the arrays by name.

    Both are of one file, also if another one takes its name meanwhile.

    Raises:
        InputError: the file is missing, a pickle, no safetensors file, or of another format.
    """
    try:
        start = read_regular(path, 4)
    except OSError as error:
        raise InputError(f'{path}: cannot be read ({error.strerror})') from None
    try:
        with safetensors.safe_open(path, framework='numpy') as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (safetensors.SafetensorError, TypeError, AttributeError) as error:  # or unknown types
        # checked last: a valid file begins with its length, which may look like a pickle
        if start.startswith(_PICKLES):
            raise InputError(
                f'{path}: a pickle, which may run code; only .safetensors files are read'
            ) from None
        raise InputError(f'{path}: not a safetensors file ({error})') from None
    if _KEY not in metadata:
        raise InputError(f'{path}: made by another program, needs {file_format}')
    try:
        description = json_value(metadata[_KEY])
        found = description.pop('format')
    except (AttributeError, KeyError, ValueError):
        raise InputError(f'{path}: its description is damaged; make it again') from None
    if found != file_format:
        raise InputError(f'{path}: made as {found}, needs {file_format}; train or build it again')
    return description, tensors
