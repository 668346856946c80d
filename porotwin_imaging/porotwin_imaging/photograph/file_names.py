"""Names of files for messages and for sorting, whatever bytes they consist of."""

import re

LONGEST_NAME = 80
"""Characters of a name in a message; the middle of a longer name is left out."""
_KEPT_BYTE = '\\udc'
"""Start of the escape of a byte that is no UTF-8, as Python keeps it in a name."""


def printable(name: str) -> str:
    """Return `name` as one short line of valid text; other characters become escapes."""
    escaped = one_line(name)
    if len(escaped) <= LONGEST_NAME:
        return escaped
    half = LONGEST_NAME // 2 - 1
    return f'{escaped[:half]}..{escaped[-half:]}'


def one_line(text: str) -> str:
    """Return `text` as one line that logs and ROS accept.

    Names on Linux are bytes. Bytes that are no UTF-8 and control characters become escapes such as
    `\\xff`.
    """
    return ''.join(map(_escaped, text))


def _escaped(letter: str) -> str:
    if letter.isprintable():
        return letter
    return letter.encode('unicode_escape').decode('ascii').replace(_KEPT_BYTE, '\\x')


def natural_order(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key that counts: `IMG_9` comes before `IMG_10`."""
    parts = re.findall(r'[0-9]+|[^0-9]+', name)
    return tuple(
        (0, int(part), part) if part[0] in '0123456789' else (1, 0, part) for part in parts
    )
