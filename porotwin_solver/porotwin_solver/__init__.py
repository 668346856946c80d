"""Physics-based model: Darcy flow and tracer transport by finite volumes, as a service."""

import porotwin_core  # noqa: F401  before NumPy, whose threads it sets
