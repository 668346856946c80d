"""The class of effects with its search parameters and words, and the registry of all effects."""
