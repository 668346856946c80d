"""Times between two looks at things that give no sign of a change, and waits for an end."""

POLL_S = 0.2
"""Period of looks during a short wait [s]: people notice no delay."""

HEARTBEAT_S = 1.0
"""Period of other looks, and of reports of health [s]: the customary rate of /diagnostics."""

END_S = 5.0
"""Longest wait for the end of a thread or process that was told to end [s]; it takes milliseconds.
One that waits for a dead disk may never end."""
