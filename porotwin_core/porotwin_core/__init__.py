"""Shared language of PoroTwin: rig, grid, well rates, units, messages to arrays and back."""

import porotwin_core.libraries  # noqa: F401  before all others: it names old libraries

__version__ = '0.1.0'
PROGRAM = f'PoroTwin {__version__}'
"""Name and version of this program, as files name it."""
