"""Denoised maps with their deviations."""
