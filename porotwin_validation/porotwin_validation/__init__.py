"""Validation of the diagnosis: blinded cases of the virtual rig, a baseline method, a benchmark."""
