"""What numbers are raised to before they divide."""

SMALLEST_DIVISOR = 1e-9
"""A quotient of two vanishing numbers is then 0, or large, and no error."""
