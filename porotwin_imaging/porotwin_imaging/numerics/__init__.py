"""Numerics of any array: robust statistics, sums over cells, bands."""
