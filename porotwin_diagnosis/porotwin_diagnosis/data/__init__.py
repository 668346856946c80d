"""Recordings prepared for a comparison with the model: selected frames, noise, residuals."""
