"""Measures of plumes and of courses of maps."""
