"""How much the pumps deliver."""
