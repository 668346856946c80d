"""The guard between hub and pumps: `guard` checks setpoints, `guard_node` is its node."""
