"""The porotwin command: one module in `commands/` for each, helpers beside."""
