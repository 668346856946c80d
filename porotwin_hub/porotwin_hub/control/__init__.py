"""The controller: plans, their optimisation and the limits of a setpoint."""
