"""From fits to a verdict: gathers the evidence, then decides by named rules."""
