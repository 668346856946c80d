"""The time between photographs that is assumed where nobody gives one, and the times allowed."""

from porotwin_core.basis.units import DAY_S

USUAL_PHOTO_INTERVAL_S = 30.0
"""Time between photographs [s], as in the paper's section 4."""

SHORTEST_PHOTO_INTERVAL_S, LONGEST_PHOTO_INTERVAL_S = 0.1, DAY_S
"""Times between photographs [s] that a node accepts."""

LONGEST_GAP_INTERVALS = 10
"""Longest time between two states in photo intervals. After a longer one the sequence begins anew,
and nothing is predicted over it. A few lost photographs are no interruption."""

VALIDITY_INTERVALS = 3
"""Photo intervals that a setpoint is valid: two photographs may be lost before control ends, and
the page warns."""

LONGEST_GAP_S = 7 * DAY_S
"""No experiment has pauses longer than a week [s]."""

SILENT_INTERVALS = 2.0
"""Photo intervals without a photograph, or a report, after which people are warned."""
