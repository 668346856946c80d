"""The running twin over a day, with killed nodes and damaged files."""
