"""Photographs of CO2 with a pH indicator: water, dissolved CO2 and gas."""
