"""The way from photographs to maps, and remarks about the result."""
