"""Predictions of the model with any effects, fits of effects, and the map of the gap."""
