"""Advice: the next experiment, and the smallest visible strength of each effect."""
