"""The presets: a name, an advection scheme, and whether the model refines its grid.

preset    scheme       refines  purpose
fast      superbee     no       the live loop and the optimiser
accurate  third order  yes      simulation and diagnosis
sharp     compressive  yes      simulation of sharp fronts
upwind    upwind       no       the diffusive model of the paper (sec. 2.2)
implicit  upwind       no       the same with one implicit step an interval: sigma acts within it
"""

from dataclasses import dataclass

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_solver.transport.scheme import Scheme

MAX_REFINED_CELLS = 200_000
"""Most cells of a refined grid: seconds for an experiment of an hour."""


IMPLICIT = 'implicit'
"""Preset with the single steps of `implicit_model`; free runs of plans are `upwind`."""


@dataclass(frozen=True)
class Preset:
    """An advection scheme, and whether the model solves on a finer grid than the given one.

    Attributes:
        name: its name.
        scheme: its advection scheme.
        factors: numbers of parts into which each cell side may be divided, ascending; the cost
            grows with the cube.
        most_cells: cells of the finer grid, at most.
    """

    name: str
    scheme: Scheme
    factors: tuple[int, ...] = (1,)
    most_cells: int = MAX_REFINED_CELLS

    def refinement(self, grid: Grid) -> int:
        """Return the number of parts into which each cell side of `grid` is divided."""
        cells = grid.nx * grid.nz
        return max(n for n in self.factors if n == 1 or cells * n**2 <= self.most_cells)


PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset('fast', Scheme.SUPERBEE),
        Preset('accurate', Scheme.THIRD_ORDER, (1, 2, 4)),
        Preset('sharp', Scheme.COMPRESSIVE, (1, 2, 3), 2 * MAX_REFINED_CELLS),
        Preset('upwind', Scheme.UPWIND),
        Preset(IMPLICIT, Scheme.UPWIND),
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


def free_run_preset(name: str) -> Preset:
    """Return the preset `name` of a free run.

    Raises:
        InputError: as `preset_named`, or it has single intervals only.
    """
    if name == IMPLICIT:
        raise InputError(
            f"preset '{name}': is one step an interval, for COSTA; free runs take upwind"
        )
    return preset_named(name)
