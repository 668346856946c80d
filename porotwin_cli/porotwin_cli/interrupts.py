"""Ctrl-C, SIGTERM or SIGHUP at any moment of a command: one line and a status of its own.

This module imports the standard library only, so that it is there before other modules load.
"""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

INTERRUPTED = 128 + signal.SIGINT
"""Exit status after Ctrl-C, as shells have it. After another signal it is 128 and its number."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a command."""


@contextmanager
def told_in_one_line() -> Iterator[None]:
    """End the process with one line after Ctrl-C, SIGTERM or SIGHUP in the block.

    They raise KeyboardInterrupt, so that the block ends its children. The signal itself is
    noted, because compiled code turns a KeyboardInterrupt into other errors.

    Raises:
        SystemExit: with 128 and the number of the signal.
    """
    noted: list[int] = []

    def note(number: int, _: object) -> None:
        noted.append(number)
        raise KeyboardInterrupt

    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number, handler in before.items():
        if handler in (signal.default_int_handler, signal.SIG_DFL):  # others are ignored, or set
            signal.signal(number, note)
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
        for number, handler in before.items():
            signal.signal(number, handler)
    print('porotwin: interrupted', file=sys.stderr, flush=True)
    sys.exit(128 + noted[-1] if noted else INTERRUPTED)
