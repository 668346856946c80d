"""The blind check: cases with a hidden truth, their diagnosis and its score."""
