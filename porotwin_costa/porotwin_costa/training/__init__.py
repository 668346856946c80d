"""Training of networks, one step ahead and over free runs."""
