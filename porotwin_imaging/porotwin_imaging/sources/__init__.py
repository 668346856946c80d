"""Camera sources: one module each; `source_registry` finds them."""
