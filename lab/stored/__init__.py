"""Recordings whose truth is known, with all simulations of their diagnosis, to judge rules by."""
