"""When a recording was made, from its files or from the user."""

from datetime import UTC, datetime
from pathlib import Path

from porotwin_core.basis.errors import InputError

RECORDED = ('rates.csv', 'rates_measured.csv', 'imaging.csv', '*.mcap')
"""Files of a recording that nobody writes later."""


def parse_date(text: str) -> datetime:
    """Return the date in `text`, ISO 8601; without a time zone it is local.

    Raises:
        InputError: it is none.
    """
    try:
        date = datetime.fromisoformat(text).astimezone()
        date.timestamp()  # the years 1 and 9999 may have none
    except (ValueError, OverflowError):
        raise InputError(f'{text!r} is no date; write 2026-11-23 or 2026-11-23T14:30') from None
    return date


def date_of_files(source: Path) -> datetime:
    """Return the earliest time at which a file of the recording `source` was last changed.

    Copies of files may be younger than the recording.

    Raises:
        InputError: the recording is not there.
    """
    folder = source if source.is_dir() else source.parent
    files = [file for name in RECORDED for file in folder.glob(name)] if source.is_dir() else []
    try:
        stamps = [file.stat().st_mtime for file in files or [source]]
    except OSError as error:
        raise InputError(f'{source}: {error.strerror}; name a recording that exists') from None
    return datetime.fromtimestamp(max(min(stamps), 0.0), UTC).astimezone()
