"""Limits of the parameters of effects, for the model and the virtual rig alike.

They are wide: every rig with sand and water lies within. A value outside is a slip of the hand or
of a program. Far outside, the equations cannot be solved, or not within any useful time.
"""

import math

MOST_DENSITY_DIFFERENCE = 1000.0
"""Density of the stock minus the density of water [kg/m3]: gas, or a brine heavier than any."""

MOST_VISCOSITY_RATIO = 1e3
"""Viscosity of the stock over the viscosity of water [-], or its inverse: glycerol, or gas."""

MOST_RETARDATION = 1e4
"""Retardation factor [-]: tracer that does not move within any experiment."""

MOST_CHANGE = 1.0
"""Rate of decay, of exchange with resting water or of a drift of the light [1/s]: over within a
second."""

MOST_FACTOR = 100.0
"""Porosity, depth, rate of a pump, exponent of the camera or scale of its picture over the nominal
one [-], or the inverse."""

MOST_PERMEABILITY_FACTOR = 1e9
"""Permeability of a zone over the permeability of the sand [-], or the inverse: more than from clay
to gravel."""

MOST_HALF_WAVES = 100.0
"""Half waves of the permeability along a side [-]: finer than any grid of the sand."""

MOST_DIFFUSION = 1e-3
"""Diffusion [m2/s]: a million times the molecular one."""

MOST_VELOCITY = 0.1
"""Darcy flux in gravel on a steep slope, or velocity of dye that sinks like coarse sand [m/s]."""

MOST_LEAK_ML_H = 1e7
"""Water lost or gained at one place [ml/h]: ten cubic metres."""

MOST_TUBE_ML = 1e4
"""Water in the tube of a well [ml]: ten metres of a garden hose hold an eighth."""

LEAST_RADIUS = 1e-6
"""Radius of a zone [m]: less than a grain."""

MOST_DISTANCE = 100.0
"""Place, radius, displacement, dispersivity or rise of a water level [m]: the largest laboratory
tanks are 20 m wide."""

MOST_LIGHT_GRADIENT = 1000.0
"""Gradient of the light [1/m]: twice as bright within a millimetre."""

MOST_ROTATION = math.pi
"""Rotation of the picture [rad]: half a turn."""
