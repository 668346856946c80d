"""One colour for each well of a rig, the same in all pictures."""

from porotwin_core.rig import Rig

COLOURS = tuple(f'C{number}' for number in range(10))
"""Colours of the first wells, by the names of matplotlib's cycle; further wells begin anew."""


def well_colours(rig: Rig) -> dict[str, str]:
    """Return the colour of every well of `rig`, by the order of the wells in rig.yaml."""
    return {name: COLOURS[index % len(COLOURS)] for index, name in enumerate(rig.wells)}
