"""Protocols of pumps, one module each; `pump_protocol` holds their contract."""
