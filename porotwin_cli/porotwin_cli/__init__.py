"""The porotwin command: one module in `commands/` for each; the others are helpers."""
