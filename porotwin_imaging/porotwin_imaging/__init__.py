"""Photographs of the rig: camera ingest and conversion to tracer concentration maps."""
