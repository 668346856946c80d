"""A photograph as a file: its name, time, bytes and linear light."""
