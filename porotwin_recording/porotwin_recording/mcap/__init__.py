"""Bags: MCAP files that are written safely and read after damage."""
