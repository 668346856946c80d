"""The hash of a file: the name of a calibration in a map."""

import hashlib
from pathlib import Path


def sha256_of_file(path: Path | str | None) -> str:
    """Return the SHA-256 of the file `path` as hexadecimal digits; empty without a file."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest() if path else ''
