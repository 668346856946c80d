"""Shared language of PoroTwin: rig, grid, well rates, units, messages to arrays and back."""

__version__ = '0.1.0'
