"""The presets: a name, an advection scheme, and whether the model refines its grid.

preset    scheme       refines  purpose
fast      superbee     no       the live loop and the optimiser
accurate  third order  yes      simulation and diagnosis
sharp     superbee     yes      simulation of sharp fronts
upwind    upwind       no       the diffusive model of the paper (sec. 2.2)
implicit  upwind       no       the same with one implicit step an interval: sigma acts within it
"""

from dataclasses import dataclass

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_solver.scheme import Scheme

MAX_REFINED_CELLS = 200_000
"""Cells up to which a preset refines a grid: seconds for an experiment of an hour."""

MAX_REFINEMENT = 4
"""Largest refinement factor, a power of two; the cost grows with its cube."""


IMPLICIT = 'implicit'
"""Preset whose single steps are those of `implicit_model`; free runs of plans are `upwind`."""


@dataclass(frozen=True)
class Preset:
    """An advection scheme, and whether the model solves on a finer grid than the given one."""

    name: str
    scheme: Scheme
    refines: bool

    def refinement(self, grid: Grid) -> int:
        """Return the number of parts into which each cell side of `grid` is divided: 1, 2 or 4."""
        factor = 1
        while (
            self.refines
            and factor < MAX_REFINEMENT
            and grid.nx * grid.nz * (2 * factor) ** 2 <= MAX_REFINED_CELLS
        ):
            factor *= 2
        return factor


PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset('fast', Scheme.SUPERBEE, refines=False),
        Preset('accurate', Scheme.THIRD_ORDER, refines=True),
        Preset('sharp', Scheme.SUPERBEE, refines=True),
        Preset('upwind', Scheme.UPWIND, refines=False),
        Preset(IMPLICIT, Scheme.UPWIND, refines=False),
    )
}
"""Every preset by name."""


def preset_named(name: str) -> Preset:
    """Return the preset `name`.

    Raises:
        InputError: there is no such preset; the message lists the known ones.
    """
    if name not in PRESETS:
        raise InputError(f"preset '{name}': unknown; choose from {', '.join(PRESETS)}")
    return PRESETS[name]
