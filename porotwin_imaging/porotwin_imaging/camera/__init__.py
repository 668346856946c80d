"""How photographs are taken from a source in time and passed on."""
