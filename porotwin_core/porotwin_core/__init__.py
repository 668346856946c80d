"""Shared language of PoroTwin: rig, grid, well rates, units, messages to arrays and back."""
