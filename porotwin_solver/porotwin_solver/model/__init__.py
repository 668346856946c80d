"""The model of one rig: coupling of flow and transport, presets, simulations."""
