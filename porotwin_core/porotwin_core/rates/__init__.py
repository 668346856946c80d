"""Rates of wells: what they are, and which were in force when."""
