"""Experiment folders and MCAP bags: read, write, convert, record and replay."""
