"""Pretended devices, one module for a protocol: they answer dry runs, and the tests."""
