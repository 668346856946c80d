"""Conversions between laboratory units and SI, and constants of nature."""

ML = 1e6
"""Millilitres in a cubic metre."""

MINUTE_S = 60.0
"""Seconds in a minute."""

HOUR_S = 3600.0
"""Seconds in an hour."""

DAY_S = 86400.0
"""Seconds in a day."""

LONGEST_EXPERIMENT_S = 365.0 * DAY_S
"""Longest time of an experiment [s]: a year. A longer time is a slip, a stamp since 1970 or a time
in another unit."""

ML_H = 1e-6 / 3600.0
"""One millilitre per hour in m^3/s."""

ML_MIN = 1e-6 * 60.0
"""One millilitre of tracer for one minute in m^3 s."""

DARCY = 9.869233e-13
"""One darcy in m^2 (SPE Metric Standard)."""

GRAVITY = 9.81
"""Acceleration of free fall [m/s^2], rounded as in the experiment folder format."""

MOLECULAR_DIFFUSION = 1e-9
"""Molecular diffusion of the tracer in the pores [m^2/s] (experiment folder contract)."""


def from_ml_h(rate_ml_h: float) -> float:
    """Return a pump rate [m^3/s] from millilitres per hour."""
    return rate_ml_h * ML_H


def to_ml_h(rate: float) -> float:
    """Return a pump rate in millilitres per hour from [m^3/s]."""
    return rate / ML_H


def setting_ml_h(rate: float) -> str:
    """Return a rate [m^3/s] as a person sets it at a pump, in ml/h: 500.0, 12.25 or 0.001.

    It has as many decimals as the rate, from one to three.
    """
    exact = f'{round(to_ml_h(rate), 3) + 0.0:.3f}'
    return exact[:-2] + exact[-2:].rstrip('0')


def from_ml_min(dose_ml_min: float) -> float:
    """Return a dose [m^3 s], tracer in the disallowed zone over time, from ml min."""
    return dose_ml_min * ML_MIN


def to_ml_min(dose: float) -> float:
    """Return a dose in ml min from [m^3 s]."""
    return dose / ML_MIN


def permeability_of(conductivity: float, viscosity: float, density: float) -> float:
    """Return the permeability k = K mu / (rho g) [m^2] of a hydraulic conductivity K [m/s].

    Args:
        conductivity: K [m/s], for the fluid in the rig.
        viscosity: mu [Pa s].
        density: rho [kg/m^3].
    """
    return conductivity * viscosity / (density * GRAVITY)


def conductivity_of(permeability: float, viscosity: float, density: float) -> float:
    """Return the hydraulic conductivity K = k rho g / mu [m/s] of a permeability k [m^2].

    Args:
        permeability: k [m^2].
        viscosity: mu [Pa s] of the fluid in the rig.
        density: rho [kg/m^3].
    """
    return permeability * density * GRAVITY / viscosity


def percent(share: float, digits: int = 0) -> str:
    """Return a share [-] in per cent, with a space as in all texts of the program: 45.0 %."""
    return f'{100.0 * share:.{digits}f} %'
