"""Data-driven model: the neural corrective source term (COSTA), its training and its service."""
