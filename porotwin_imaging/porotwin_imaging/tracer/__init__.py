"""From colour to concentration: the signal of the tracer and its calibration."""
