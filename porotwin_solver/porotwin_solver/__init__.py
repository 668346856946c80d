"""Physics-based model: Darcy flow and tracer transport by finite volumes, as a service."""
