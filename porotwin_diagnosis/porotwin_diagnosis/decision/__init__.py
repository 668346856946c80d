"""From fits to a verdict and its confidence."""
