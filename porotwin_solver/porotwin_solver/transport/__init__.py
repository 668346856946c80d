"""Transport of the tracer: advection, dispersion, sources and sinks."""
