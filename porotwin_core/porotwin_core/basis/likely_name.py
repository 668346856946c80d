"""What a user probably meant by a name that is not known, for one line with a remedy."""

import difflib
from collections.abc import Collection, Iterable
from unicodedata import normalize


def did_you_mean(
    name: object, known: Iterable[str], *, within: str = '', alike: float | None = None
) -> str:
    """Return "did you mean 'leak'?" with the name most like `name`; empty if none is like it.

    Args:
        name: the name that is not known.
        known: the known ones.
        within: the section of the names with a point, which the user reads before the name.
        alike: the likeness from which on a name is told, by `difflib` [-]; None: its default.
    """
    others = [one for one in known if one != str(name)]
    cutoff = {} if alike is None else {'cutoff': alike}
    near = difflib.get_close_matches(str(name), others, n=1, **cutoff)
    return f"did you mean '{within}{near[0]}'?" if near else ''


def as_known(name: str, known: Collection[str]) -> str:
    """Return the one of `known` with the letters of `name`, which have two codings; else `name`."""
    alike = (one for one in known if normalize('NFC', one) == normalize('NFC', name))
    return name if name in known else next(alike, name)
