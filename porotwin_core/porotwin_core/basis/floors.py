"""What numbers are raised to before they divide or before their logarithm is taken; round-off."""

SMALLEST_DIVISOR = 1e-9
"""A quotient or logarithm of a vanishing number is then large, and no error."""

ROUND_OFF = 1e-9
"""Part of a length, a time step, a sum of rates or a mean of ones that is round-off."""

WRITTEN_ROUND_OFF = 1e-6
"""Part of a number in a file or message that is round-off: single precision holds seven digits."""
