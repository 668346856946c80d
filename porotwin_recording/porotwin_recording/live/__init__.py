"""How the running graph is recorded, and a recording played into it."""
