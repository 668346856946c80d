"""Darcy flow: pressure, fluxes, multigrid."""
