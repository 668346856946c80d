"""Rates of wells, and their times in force."""
