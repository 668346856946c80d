"""What the owner's rig.yaml does not know: effects of the asset and of its camera, by name.

Those of the diagnosis contract, with its parameter names and conventions, and some from outside it
(`OUTSIDE_LIBRARY`), with which a diagnosis is tested for admitting that it has no explanation.
"""

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.units import MOLECULAR_DIFFUSION

Parameters = Mapping[str, float | str]

PHYSICS: Mapping[str, Parameters] = MappingProxyType(
    {
        'dispersion': {
            'longitudinal_dispersivity': 0.0,
            'transverse_dispersivity': 0.0,
            'diffusion': MOLECULAR_DIFFUSION,
        },
        'buoyancy': {'density_difference': 0.0},
        'viscosity': {'viscosity_ratio': 1.0},
        'retardation': {'retardation_factor': 1.0},
        'decay': {'rate': 0.0},
        'dual_porosity': {'immobile_fraction': 0.0, 'exchange_rate': 0.0},
        'heterogeneity': {'x': 0.0, 'z': 0.0, 'radius': 0.05, 'permeability_factor': 1.0},
        'porosity': {'factor': 1.0},
        'depth': {'factor_centre': 1.0},
        'rate': {'well': '', 'factor': 1.0},
        'well_position': {'well': '', 'dx': 0.0, 'dz': 0.0},
        'leak': {'x': 0.0, 'z': 0.0, 'rate': 0.0},
        'background_flow': {'x_velocity': 0.0, 'z_velocity': 0.0},
    }
)
"""Physical effects of the diagnosis contract with their parameters and the values of no effect."""

IMAGE: Mapping[str, Parameters] = MappingProxyType(
    {
        'saturation': {'exponent': 1.0},
        'illumination': {'drift': 0.0, 'gradient': 0.0},
        'registration': {'dx': 0.0, 'dz': 0.0, 'rotation': 0.0, 'scale': 1.0},
        'clock': {'offset': 0.0},
    }
)
"""Effects of the camera in the diagnosis contract."""

OUTSIDE_PHYSICS: Mapping[str, Parameters] = MappingProxyType(
    {
        # a thin line of other permeability from (x, z) to (x_end, z_end), `width` [m] thick
        'streak': {
            'x': 0.0,
            'z': 0.0,
            'x_end': 0.0,
            'z_end': 0.0,
            'width': 0.006,
            'permeability_factor': 0.01,
        },
        # a pump swings about its rate: factor 1 + amplitude sin(2 pi t / period)
        'pulsation': {'well': '', 'amplitude': 0.0, 'period': 600.0},
        # a pump wears out: factor 1 + drift t
        'pump_drift': {'well': '', 'drift': 0.0},
        # sorbed = capacity c ** exponent per pore volume, in equilibrium
        'freundlich': {'capacity': 0.0, 'exponent': 0.6},
        # the layer between two heights conducts better along x (z) by (1 over) root of `ratio`
        'anisotropy': {'z_low': 0.0, 'z_high': 0.0, 'ratio': 1.0},
        # tracer particles sink through the water at `velocity` [m/s]
        'settling': {'velocity': 0.0},
        # the water table sways: potential amplitude sin(2 pi t / period) (x / W - 1/2) [m] on top
        'water_table': {'amplitude': 0.0, 'period': 1800.0},
    }
)
"""Physical effects that no diagnosis library names; their conventions stand beside them."""

OUTSIDE_IMAGE: Mapping[str, Parameters] = MappingProxyType(
    {
        # a round reflection adds to the signal: strength exp(-r^2 / (2 radius^2)), wandering up
        'reflection': {'x': 0.0, 'z': 0.0, 'radius': 0.03, 'strength': 0.0, 'climb': 0.0},
        # the signal lags behind the tracer, as a slow stain does: d signal/dt = (c - signal)/delay
        'stain': {'delay': 0.0},
    }
)
"""Effects of the camera that no diagnosis library names."""

OUTSIDE_LIBRARY = frozenset((*OUTSIDE_PHYSICS, *OUTSIDE_IMAGE))
"""Names of the effects whose right diagnosis is `unexplained`."""

KNOWN: Mapping[str, Parameters] = MappingProxyType(
    {**PHYSICS, **IMAGE, **OUTSIDE_PHYSICS, **OUTSIDE_IMAGE}
)

_POSITIVE = frozenset(
    {
        ('viscosity', 'viscosity_ratio'),
        ('heterogeneity', 'radius'),
        ('heterogeneity', 'permeability_factor'),
        ('porosity', 'factor'),
        ('depth', 'factor_centre'),
        ('saturation', 'exponent'),
        ('registration', 'scale'),
        ('streak', 'permeability_factor'),
        ('pulsation', 'period'),
        ('freundlich', 'exponent'),
        ('anisotropy', 'ratio'),
        ('water_table', 'period'),
        ('reflection', 'radius'),
    }
)
"""(effect, parameter) that divides, or scales what cannot be zero."""

_RANGES: Mapping[tuple[str, str], tuple[float, float]] = MappingProxyType(
    {
        ('dispersion', 'longitudinal_dispersivity'): (0.0, math.inf),
        ('dispersion', 'transverse_dispersivity'): (0.0, math.inf),
        ('dispersion', 'diffusion'): (0.0, math.inf),
        ('retardation', 'retardation_factor'): (1.0, math.inf),
        ('decay', 'rate'): (0.0, math.inf),
        ('dual_porosity', 'immobile_fraction'): (0.0, 0.95),
        ('dual_porosity', 'exchange_rate'): (0.0, math.inf),
        ('rate', 'factor'): (0.0, math.inf),
        ('streak', 'width'): (0.0, math.inf),
        ('freundlich', 'capacity'): (0.0, math.inf),
        ('settling', 'velocity'): (0.0, math.inf),
        ('stain', 'delay'): (0.0, math.inf),
    }
)
"""Least and largest value of (effect, parameter)."""


class Effects:
    """Effects by name, checked against a rig: `effects['decay']['rate']` is always there."""

    def __init__(self, described: Iterable[EffectDescription], rig: Rig) -> None:
        self._given: dict[str, list[dict[str, float | str]]] = {}
        for effect in described:
            self._given.setdefault(effect.name, []).append(_checked(effect, rig))

    def __contains__(self, name: object) -> bool:
        return name in self._given

    def all(self, name: str) -> list[dict[str, float | str]]:
        """Return the parameters of every effect called `name`; several wells may have one each."""
        return self._given.get(name, [])

    def number(self, name: str, parameter: str) -> float:
        """Return a parameter of the effect `name`, or its value of no effect."""
        given = self._given.get(name)
        return float((given[-1] if given else KNOWN[name])[parameter])


def _checked(effect: EffectDescription, rig: Rig) -> dict[str, float | str]:
    if effect.name not in KNOWN:
        raise InputError(f"effect '{effect.name}' is not known; choose from {', '.join(KNOWN)}")
    neutral = KNOWN[effect.name]
    for parameter, value in effect.parameters.items():
        if parameter not in neutral:
            raise InputError(
                f"effect '{effect.name}' has no parameter '{parameter}'; "
                f'it has {", ".join(neutral)}'
            )
        if isinstance(neutral[parameter], str) != isinstance(value, str):
            raise InputError(f"effect '{effect.name}': {parameter} = {value!r} is of a wrong kind")
        if isinstance(value, float):
            _check_range(effect.name, parameter, value)
    parameters = {**neutral, **effect.parameters}
    well = parameters.get('well')
    if well is not None and well not in rig.wells:
        raise InputError(
            f"effect '{effect.name}' names an unknown well '{well}'; known: {', '.join(rig.wells)}"
        )
    return parameters


def _check_range(effect: str, parameter: str, value: float) -> None:
    low, high = _RANGES.get((effect, parameter), (-math.inf, math.inf))
    if (effect, parameter) in _POSITIVE and value <= 0.0:
        bound = 'greater than 0'
    elif value < low:
        bound = f'at least {low:g}'
    elif value > high:
        bound = f'at most {high:g}'
    else:
        return
    raise InputError(f"effect '{effect}': {parameter} = {value:g} must be {bound}")


def parse_effects(text: str) -> tuple[EffectDescription, ...]:
    """Return the effects written as `NAME:PARAMETER=VALUE,...;NAME:...` on a command line.

    Raises:
        InputError: the text is not of that form.
    """
    effects = []
    for part in filter(None, (piece.strip() for piece in text.split(';'))):
        name, _, assignments = part.partition(':')
        parameters: dict[str, float | str] = {}
        for assignment in filter(None, (piece.strip() for piece in assignments.split(','))):
            key, equals, value = assignment.partition('=')
            if not equals:
                raise InputError(f"effect '{part}': write NAME:PARAMETER=VALUE,... with numbers")
            parameters[key.strip()] = _value(value.strip())
        effects.append(EffectDescription(name=name.strip(), parameters=parameters))
    return tuple(effects)


def _value(text: str) -> float | str:
    try:
        number = float(text)
    except ValueError:
        return text
    return number if math.isfinite(number) else text
