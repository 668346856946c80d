"""Limits of the parameters of effects, for the model and the virtual rig alike.

They are wide: every rig with sand and water lies within. A value outside is a slip of the hand or
of a program. Far outside, the equations cannot be solved, or not within any useful time.
"""

import math

MOST_DENSITY_DIFFERENCE = 1000.0
"""Density of the stock minus the density of water [kg/m3]: gas, or a brine heavier than any."""

LEAST_VISCOSITY_RATIO, MOST_VISCOSITY_RATIO = 1e-3, 1e3
"""Viscosity of the stock over the viscosity of water [-]: gas to glycerol."""

MOST_RETARDATION = 1e4
"""Retardation factor [-]: tracer that does not move within any experiment."""

MOST_REACTION_RATE = 1.0
"""Rate of decay, or of exchange with resting water [1/s]: over within a second."""

LEAST_FACTOR, MOST_FACTOR = 0.01, 100.0
"""Porosity, depth, rate of a pump or exponent of the camera over the nominal one [-]."""

LEAST_PERMEABILITY_FACTOR, MOST_PERMEABILITY_FACTOR = 1e-9, 1e9
"""Permeability of a zone over the permeability of the sand [-]: more than from clay to gravel."""

MOST_HALF_WAVES = 100.0
"""Half waves of the permeability along a side [-]: finer than any grid of the sand."""

MOST_DISPERSIVITY = 10.0
"""Dispersivity [m] of an aquifer, far more than in any rig."""

MOST_DIFFUSION = 1e-3
"""Diffusion [m2/s]: a million times the molecular one."""

MOST_DARCY_FLUX = 0.1
"""Darcy flux [m/s] in gravel on a steep slope."""

MOST_SETTLING_VELOCITY = 0.1
"""Velocity of dye that sinks through water [m/s]: as fast as coarse sand."""

MOST_WATER_LEVEL = 10.0
"""Amplitude of a swinging water table [m]: more than any laboratory tank is high."""

MOST_LEAK_ML_H = 1e7
"""Water lost or gained at one place [ml/h]: ten cubic metres."""

MOST_TUBE_ML = 1e4
"""Water in the tube of a well [ml]: ten metres of a garden hose hold an eighth."""

LEAST_RADIUS = 1e-6
"""Radius of a zone [m]: less than a grain."""

MOST_DISTANCE = 100.0
"""Place, radius or displacement [m]: the largest laboratory tanks are 20 m wide."""

MOST_LIGHT_DRIFT = 1.0
"""Drift of the light [1/s]: twice as bright within a second."""

MOST_LIGHT_GRADIENT = 1000.0
"""Gradient of the light [1/m]: twice as bright within a millimetre."""

MOST_ROTATION = math.pi
"""Rotation of the picture [rad]: half a turn."""

LEAST_SCALE, MOST_SCALE = 0.1, 10.0
"""Scale of the picture [-]."""

MOST_CLOCK_OFFSET = 3.2e8
"""Offset of a clock [s]: ten years."""
