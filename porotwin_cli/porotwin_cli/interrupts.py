"""Ctrl-C at any moment of a command: one line and a status of its own, also while modules load.

This module imports the standard library only, so that it is there first.
"""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it: 128 and the number of the signal."""


@contextmanager
def told_in_one_line() -> Iterator[None]:
    """End the process with one line after Ctrl-C in the block.

    The signal itself is noted, because compiled code turns a KeyboardInterrupt into other errors.

    Raises:
        SystemExit: with the status `INTERRUPTED`.
    """
    noted: list[int] = []

    def note(number: int, _: object) -> None:
        noted.append(number)
        raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:  # a background job of a shell ignores Ctrl-C
        signal.signal(signal.SIGINT, note)
    try:
        yield
    except SystemExit as end:  # typer turns Ctrl-C into a status without a word
        if end.code != INTERRUPTED:
            raise
    except BaseException as error:
        if not (noted or isinstance(error, KeyboardInterrupt)):
            raise
    else:
        return
    finally:
        signal.signal(signal.SIGINT, before)
    print('porotwin: interrupted', file=sys.stderr, flush=True)
    sys.exit(INTERRUPTED)
