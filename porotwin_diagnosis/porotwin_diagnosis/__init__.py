"""Diagnosis of the sim-to-real gap: its place, the effect that causes it, and its reduction."""
