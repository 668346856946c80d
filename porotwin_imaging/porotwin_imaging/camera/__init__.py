"""The node that takes photographs from a source and publishes them."""
