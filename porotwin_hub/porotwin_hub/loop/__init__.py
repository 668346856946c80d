"""The loop of the twin, from a state to a setpoint and a forecast."""
