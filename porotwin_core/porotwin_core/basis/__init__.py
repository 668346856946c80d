"""Parts that know nothing of a rig: errors, units, whole files, parallel work."""
