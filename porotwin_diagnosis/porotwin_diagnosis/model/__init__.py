"""Effects as parameters of simulations, and their fits to a recording."""
