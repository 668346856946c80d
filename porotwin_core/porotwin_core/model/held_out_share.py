"""The part of a recording that is kept to test what was learnt from the rest."""

HELD_OUT_SHARE = 0.3
"""Share of the time of a recording [-], its last part."""
