"""Folders that are written completely or not at all: a program may be killed at any moment."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from porotwin_core.basis.errors import InputError


@contextmanager
def whole_folder(
    path: Path, *, source: str = '', named: bool = False, replaces: bool = False
) -> Iterator[Path]:
    """Yield a hidden folder beside `path` to write to; it becomes `path` when the block ends.

    An error or an interrupt in the block removes the hidden folder. A kill leaves it. The next call
    for `path` removes it and begins again.

    ```
    with whole_folder(path) as unfinished:
        (unfinished / 'rig.yaml').write_text(text)
    ```

    Args:
        path: the folder; with `named` also a file.
        source: what the folder is made from. With it, an interrupt leaves the hidden folder as
            well. A call with the same source goes on in it, and finds all that was written.
        named: yield a path in the hidden folder that does not exist yet and has the name of `path`,
            for a writer that names files after it.
        replaces: `path` may exist; the new files replace those of the same names, one by one.

    Raises:
        InputError: `path` exists at the end of the block, without `replaces`.
        OSError: the folder cannot be made, or cannot get its name.
    """
    hidden, mark = (path.with_name(f'.{path.name}.{kind}') for kind in ('partial', 'source'))
    if not (source and mark.is_file() and mark.read_text(encoding='utf-8') == source):
        _remove(hidden, mark)
    hidden.mkdir(parents=True, exist_ok=True)
    if source:
        mark.write_text(source, encoding='utf-8')
    made = hidden / path.name if named else hidden
    try:
        yield made
        _put(made, path, replaces=replaces)
    except BaseException as error:
        if not source or isinstance(error, Exception):
            _remove(hidden, mark)
        raise
    _remove(hidden, mark)


def _put(made: Path, path: Path, *, replaces: bool) -> None:
    """Rename `made` to `path`; if this exists, move the files into it."""
    if not path.exists():
        made.rename(path)
        return
    if not replaces:
        raise InputError(f'{path}: exists already; name another or remove it')
    for file in made.iterdir():
        file.replace(path / file.name)


def _remove(hidden: Path, mark: Path) -> None:
    shutil.rmtree(hidden, ignore_errors=True)
    mark.unlink(missing_ok=True)
