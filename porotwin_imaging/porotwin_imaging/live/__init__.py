"""The node that maps photographs as they come."""
