"""A virtual rig: an independent stand-in for the physical asset, with a photograph renderer."""
