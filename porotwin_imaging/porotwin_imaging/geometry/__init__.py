"""From metres in the rig to pixels: corners, lens, alignment, sampling."""
