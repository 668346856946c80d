"""Learnt physics first, then fluxes between neighbouring cells for the remainder."""

from dataclasses import replace

from porotwin_costa.networks.local import ARCHITECTURE as LOCAL

ARCHITECTURE = replace(
    LOCAL,
    name='hybrid',
    summary='learnt physics (sand, density, spreading, drift, leaks), fluxes for the remainder',
    learns_physics=True,
)
