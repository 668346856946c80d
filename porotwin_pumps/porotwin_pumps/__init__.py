"""Real pumps: `pump_file` says which well has which pump, `bridge` sets and measures the pumps.

Each protocol is one module in `protocols`, and `protocol_registry` finds it. docs/pumps.md explains
the pump file and how to add a protocol.
"""
