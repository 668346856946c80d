"""The class of effects of the virtual rig, and the registry of all effects."""
