"""Other people's tables, dates, units and maps."""
