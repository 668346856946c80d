"""Errors of predictions with and without COSTA."""
