"""Statistics that outliers hardly change."""

SPREAD_PER_DEVIATION = 1.4826
"""Standard deviation of a normal distribution relative to its median absolute deviation."""
