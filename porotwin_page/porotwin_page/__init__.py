"""The page that a person watches and operates beside the rig."""
