"""An effect and a pump of our laboratory."""
