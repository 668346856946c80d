"""The photograph before the tracer: what is measured once, which cells are seen."""
