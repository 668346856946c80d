"""Protocols of pumps, one module each; `pump_protocol` defines their interface."""
