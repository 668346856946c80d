"""Text files that are written completely or not at all: a check may be killed at any moment."""

import os
from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Write `text` to `path`; a kill or a full disk leaves the file as it was.

    Raises:
        OSError: the disk is full or fails, or the folder may not be written.
    """
    unfinished = path.with_name(f'{path.name}.{os.getpid()}.part')
    unfinished.write_text(text, encoding='utf-8')
    unfinished.replace(path)
