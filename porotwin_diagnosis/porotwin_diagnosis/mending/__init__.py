"""Mending of the running twin: when to diagnose, offers, and removal of effects."""
