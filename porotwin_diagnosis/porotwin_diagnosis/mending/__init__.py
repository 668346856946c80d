"""The running twin gets better: when to diagnose, what to offer, and when to take it back."""
