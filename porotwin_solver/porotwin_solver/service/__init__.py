"""The node that serves predictions."""
