"""Recordings and runs that are read: their figures, conversion, and use for training."""
