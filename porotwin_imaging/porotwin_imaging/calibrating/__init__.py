"""How a calibration is fitted to a known injection, and whether to trust it."""
