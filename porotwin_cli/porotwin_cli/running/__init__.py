"""Twins that run: beside a rig, in the demo, and in simulated loops."""
