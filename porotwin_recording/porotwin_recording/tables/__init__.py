"""Files of an experiment folder: rates, photographs, maps."""
