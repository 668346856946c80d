"""What a user probably meant by a name that is not known, for one line with a remedy."""

import difflib
from collections.abc import Collection, Iterable
from unicodedata import normalize

USUALLY_ALIKE = 0.6
"""Likeness of two names from which one is probably meant by the other [-]: twice the number of
letters that both have in order, over all letters."""


def did_you_mean(
    name: object, known: Iterable[str], *, within: str = '', alike: float = USUALLY_ALIKE
) -> str:
    """Return "did you mean 'leak'?" with the name most like `name`; empty if none is like it.

    Args:
        name: the name that is not known.
        known: the known ones.
        within: the section of the names with a point, which the user reads before the name.
        alike: the likeness from which on a name is told [-].
    """
    others = [one for one in known if one != str(name)]
    near = difflib.get_close_matches(str(name), others, n=1, cutoff=alike)
    return f"did you mean '{within}{near[0]}'?" if near else ''


def as_known(name: str, known: Collection[str]) -> str:
    """Return the one of `known` with the letters of `name`, which have two codings; else `name`."""
    alike = (one for one in known if normalize('NFC', one) == normalize('NFC', name))
    return name if name in known else next(alike, name)
