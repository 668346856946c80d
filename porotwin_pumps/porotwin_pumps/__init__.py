"""Real pumps: `pump_file` says which well has which pump, `bridge` sets and measures them.

Each protocol is one module in `protocols`, found by its `protocol_registry`. docs/pumps.md says how
to describe pumps and how to add a protocol.
"""
