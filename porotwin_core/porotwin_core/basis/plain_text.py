"""Text that somebody else wrote, harmless on a terminal."""

import re
import sys
import unicodedata
from io import TextIOWrapper

_UNSEEN = frozenset({'Cc', 'Cf', 'Cs', 'Co', 'Cn', 'Zl', 'Zp'})
"""Categories of characters that nobody sees: controls, marks of direction, ends of lines."""

_BLANK = re.compile('[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0'
                    '\U000e0100-\U000e01ef]')  # fmt: skip
"""Letters and accents that nobody sees either: a name with one looks like the name without."""


def _is_unseen(character: str) -> bool:
    """Return whether nobody sees a `character` on a terminal or a page."""
    return unicodedata.category(character) in _UNSEEN or bool(_BLANK.match(character))


def plain(text: str) -> str:
    """Return `text` on one line: every character that acts instead of being seen by its number."""
    if text.isascii() and text.isprintable():
        return text
    return ''.join(
        one.encode('unicode_escape').decode() if _is_unseen(one) else one for one in text
    )


def show_all_characters() -> None:
    """Show characters that the terminal does not have by their number."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')
