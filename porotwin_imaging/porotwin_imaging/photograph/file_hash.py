"""The hash of a file: the name of a calibration in a map."""

import hashlib
from pathlib import Path

from porotwin_core.basis.regular_file import read_regular


def sha256_of_file(path: Path | str | None) -> str:
    """Return the SHA-256 of the file `path` as hexadecimal digits; empty without a file."""
    return hashlib.sha256(read_regular(Path(path))).hexdigest() if path else ''
