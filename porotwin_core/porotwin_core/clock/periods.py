"""Times between two looks at things that give no sign of a change."""

POLL_S = 0.2
"""Period of looks during a short wait [s]: people notice no delay."""

HEARTBEAT_S = 1.0
"""Period of other looks, and of reports of health [s]: the customary rate of /diagnostics."""
