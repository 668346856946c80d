"""Coefficients of the equations on the grid, and helpers of compiled kernels."""
