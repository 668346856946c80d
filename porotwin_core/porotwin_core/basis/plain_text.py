"""Text that somebody else wrote, harmless on a terminal."""

import unicodedata

_UNSEEN = frozenset({'Cc', 'Cf', 'Cs', 'Co', 'Cn', 'Zl', 'Zp'})
"""Categories of characters that nobody sees: controls, marks of direction, ends of lines."""


def plain(text: str) -> str:
    """Return `text` on one line: every character that acts instead of being seen by its number."""
    if text.isascii() and text.isprintable():
        return text
    return ''.join(
        one.encode('unicode_escape').decode() if unicodedata.category(one) in _UNSEEN else one
        for one in text
    )
