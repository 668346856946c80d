"""Checks of a rig and a recording before work begins."""
