"""Many processes: measured with two, and simulated with more."""
