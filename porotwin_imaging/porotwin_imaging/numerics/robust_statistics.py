"""Statistics that outliers hardly change."""

SPREAD_PER_DEVIATION = 1.4826
"""Standard deviation of a normal distribution relative to its median absolute deviation."""
NOISE_SPREADS = 4.0
"""Values farther from the middle than this many standard deviations are no noise."""
TOP_PERCENTILE = 99.5
"""Percentile that stands for the largest value of a picture: single pixels may be damaged."""
FEW_ROUNDS, ROUNDS = 6, 20
"""Rounds of a long and of a short step, in robust fits and fixed points: more change nothing."""
