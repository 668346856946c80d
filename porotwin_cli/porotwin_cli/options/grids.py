"""The grid that a user chooses with --grid, and the cost of computing on it."""

from porotwin_cli.terminal import say
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.rig.grid_oddities import MOST_CELLS, chosen_grid
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.model.prediction_cost import PredictionCost, in_words

LONG_S = 20.0
"""Expected time of a work above which a command tells it before it begins [s]."""


SECONDS_PER_COUPLED_FLOW = 2e-7
"""Time for one flow that depends on the tracer, per cell [s]; every step solves one. Measured on a
server with two cores, with 42,000 and 168,000 cells."""


def grid_of(text: str, rig: Rig, most_cells: int = MOST_CELLS) -> Grid:
    """Return the grid called `text`, such as 187x112, over `rig`; its default for empty text.

    A grid that is odd for this rig is logged as a warning.

    Raises:
        InputError: the text is no grid, or the grid cannot be computed.
    """
    return chosen_grid(text, rig, most_cells) if text else rig.default_grid()


def coupled_flow_seconds(physics: Physics, steps: int) -> float:
    """Return the time of the flows of `steps` [s] that depend on the tracer; 0 if none does."""
    cells = physics.grid.nx * physics.grid.nz
    return SECONDS_PER_COUPLED_FLOW * cells * steps if physics.is_coupled else 0.0


def tell_cost(cost: PredictionCost, work: str, times: int = 1, more: float = 0.0) -> None:
    """Say how long `work`, `times` predictions of a `cost`, will take, if it takes long.

    `more` is the time of all that the cost does not count [s].
    """
    seconds = cost.preparation_seconds + times * cost.seconds + more
    if seconds > LONG_S:
        parts = cost.refinement
        fine = f', after the preset divides each in {parts}x{parts}' if parts > 1 else ''
        say(
            f'{work}: {cost.cells:,} cells{fine}, about {in_words(seconds)}; a coarser '
            '--grid is faster'
        )
