"""How photographs are mapped as they come."""
