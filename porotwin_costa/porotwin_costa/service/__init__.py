"""The nodes that serve the corrective source term and train it."""
