"""What to measure next, and what the recording could have shown."""
