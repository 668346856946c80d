"""The nodes that record the running graph and play a recording into it."""
