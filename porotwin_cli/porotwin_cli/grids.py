"""The grid that a user chooses with --grid."""

from porotwin_core.grid import Grid
from porotwin_core.rig import Rig


def grid_of(text: str, rig: Rig) -> Grid:
    """Return the grid called `text`, such as 187x112, over `rig`; its default for empty text.

    Raises:
        InputError: the text is no grid.
    """
    return Grid.parse(text, rig.width_m, rig.height_m) if text else rig.default_grid()
