"""Camera sources: each module in this folder that defines `SOURCE` is found by the registry."""
