"""Forecasts by physics-based and data-driven model, and clients of their services."""
