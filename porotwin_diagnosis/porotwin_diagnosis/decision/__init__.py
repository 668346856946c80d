"""From the fits to a verdict: evidence first, then one decision with named rules."""
