"""Drawings of rigs, maps and runs."""
