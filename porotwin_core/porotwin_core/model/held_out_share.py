"""The part of a recording that is kept to test what was learnt from the rest."""

HELD_OUT_SHARE = 0.3
"""Share of the time of a recording [-], its last part."""


def held_out_begin(first: float, last: float) -> float:
    """Return where the held-out part of maps from `first` to `last` [s] begins."""
    return first + (1.0 - HELD_OUT_SHARE) * (last - first)
