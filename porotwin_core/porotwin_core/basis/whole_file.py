"""Files that are written completely or not at all: a program may be killed at any moment."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from porotwin_core.basis.errors import writing


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path to write to; it becomes `path` when the block ends.

    An error in the block removes the new file, and leaves `path` as it was.

    ```
    with whole_file(path) as unfinished:
        unfinished.write_bytes(data)
    ```

    Raises:
        OSError: the file cannot get its name.
    """
    # another thread may write the same file
    unfinished = path.with_name(f'.{path.name}.{os.getpid()}.{threading.get_native_id()}.partial')
    try:
        yield unfinished
        unfinished.replace(path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def write_whole(path: Path, text: str) -> None:
    """Write `text` to `path` in UTF-8; a kill or a full disk leaves the file as it was.

    Raises:
        InputError: the folder may not be written.
        OSError: the disk is full or fails.
    """
    with writing(path), whole_file(path) as unfinished:
        unfinished.write_text(text, encoding='utf-8')
