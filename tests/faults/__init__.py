"""The fault suite: faults injected into a running twin, and the documented state of each."""
