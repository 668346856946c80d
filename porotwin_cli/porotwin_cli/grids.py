"""The grid that a user chooses with --grid, and the cost of computing on it."""

from porotwin_cli.terminal import say
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_core.rig.grid_oddities import MOST_CELLS, chosen_grid
from porotwin_solver.prediction_cost import PredictionCost, in_words

LONG_S = 20.0
"""Expected time of a work above which a command tells it before it begins [s]."""


def grid_of(text: str, rig: Rig, most_cells: int = MOST_CELLS) -> Grid:
    """Return the grid called `text`, such as 187x112, over `rig`; its default for empty text.

    A grid that is odd for this rig is logged as a warning.

    Raises:
        InputError: the text is no grid, or the grid cannot be computed.
    """
    return chosen_grid(text, rig, most_cells) if text else rig.default_grid()


def tell_cost(cost: PredictionCost, work: str, times: int = 1) -> None:
    """Say how long `work`, `times` predictions of a `cost`, will take, if it takes long."""
    seconds = cost.preparation_seconds + times * cost.seconds
    if seconds > LONG_S:
        parts = cost.refinement
        fine = f', after the preset divides each in {parts}x{parts}' if parts > 1 else ''
        say(
            f'{work}: {cost.cells:,} cells{fine}, about {in_words(seconds)}; a coarser '
            '--grid is faster'
        )
