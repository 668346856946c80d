"""A command: `porotwin plume-area RECORDING`."""

from pathlib import Path

import porotwin


def command(recording: Path) -> None:
    """Print the area of the plume in the last map [cm2].

    Example: porotwin plume-area bags/sample
    """
    opened = porotwin.open_recording(recording)
    cells = int((opened.concentration[-1] > 0.5).sum())
    print(f'{1e4 * cells * opened.grid.cell_area:.0f} cm2')
