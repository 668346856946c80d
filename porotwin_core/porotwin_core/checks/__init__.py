"""Checks of finished maps against the pumps."""
