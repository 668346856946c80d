"""Shared language of PoroTwin: rig, grid, well rates, units, messages to arrays and back."""

import os

# before NumPy: sums of several threads differ in their last bits with the number of threads;
# `one_blas_thread` limits a NumPy that was imported before
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import porotwin_core.basis.libraries  # noqa: F401  before all others: it names old libraries

__version__ = '0.3.0'
PROGRAM = f'PoroTwin {__version__}'
"""Name and version of this program, as files name it."""
