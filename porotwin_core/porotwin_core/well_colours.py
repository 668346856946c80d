"""One colour for each well of a rig, the same in all pictures."""

from porotwin_core.rig import Rig

COLOURS = (
    '#1f77b4',
    '#ff7f0e',
    '#2ca02c',
    '#d62728',
    '#9467bd',
    '#8c564b',
    '#e377c2',
    '#7f7f7f',
    '#bcbd22',
    '#17becf',
)
"""Colours of the first wells; further wells begin anew."""


def well_colours(rig: Rig) -> dict[str, str]:
    """Return the colour of every well of `rig`, by the order of the wells in rig.yaml."""
    return {name: COLOURS[index % len(COLOURS)] for index, name in enumerate(rig.wells)}
