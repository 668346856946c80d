"""What numbers are raised to before they divide, or before their logarithm is taken."""

SMALLEST_DIVISOR = 1e-9
"""A quotient or logarithm of a vanishing number is then large, and no error."""
