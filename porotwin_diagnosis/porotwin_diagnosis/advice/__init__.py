"""Advice: which experiment to make next, and which effects would have been visible."""
