"""Effects and their parameters in words and units that a person at the rig uses."""

import html
import math
from collections.abc import Callable, Mapping
from typing import Any

from porotwin_core.units import MOLECULAR_DIFFUSION

Values = Mapping[str, Any]
"""Parameters of one effect by name, in the units of the diagnosis contract."""

UNITS = {
    'm': (1e3, 'mm'),
    '1/s': (3.6e5, '%/h'),
    '1/m': (10.0, '% per 10 cm'),
    'm/s': (3.6e6, 'mm/h'),
    'rad': (180 / math.pi, '°'),
    'kg/m3': (1.0, 'kg/m³'),
    'm2/s': (1.0, 'm²/s'),
    '-': (1.0, ''),
}
"""Factor and name of the unit in which a parameter is read, by its unit of the contract."""

OWN_UNITS = {'exchange_rate': (3600.0, 'per hour'), 'immobile_fraction': (100.0, '%')}

CHECKS = {
    'dispersion': 'repeat at half the rates: dispersion goes with distance, diffusion with time',
    'buoyancy': 'stop all pumps: the plume goes on sinking or rising; weigh a flask of the stock',
    'viscosity': 'measure the stock in a capillary viscometer',
    'retardation': 'shake a batch of sand with stock and measure what stays dissolved',
    'decay': 'leave a closed bottle of stock in the same light and photograph it every hour',
    'dual_porosity': 'chase with water and watch the tail at the producer',
    'heterogeneity': 'look at the sand there; inject from a well close to it',
    'porosity': 'weigh the water that fills the rig',
    'depth': 'measure the gap between the plates in the middle with a feeler gauge',
    'rate': 'collect what the pump delivers in a measuring cylinder for ten minutes',
    'well_position': 'measure where the well opens',
    'leak': 'stop all pumps and watch the water table; dry the plates and look for drops',
    'background_flow': 'inject a drop of tracer with all pumps stopped and see where it drifts',
    'saturation': 'photograph three bottles of stock diluted to known concentrations',
    'illumination': 'photograph a grey card at the start and the end, left and right',
    'registration': 'photograph a scale in the rig and mark its corners again',
    'clock': 'photograph the clock of the pumps',
    'numerical_diffusion': 'run the model with the accurate preset',
}


def spoken(name: str) -> str:
    """Return the name of an effect or parameter as one says it."""
    return name.replace('_', ' ')


def number(value: float, digits: int = 3) -> str:
    """Return `value` with `digits` significant ones, powers of ten as HTML."""
    text = f'{value:.{digits}g}'
    if 1e2 <= abs(value) < 1e5:
        text = f'{float(text):.0f}'
    if 'e' not in text:
        return text.replace('-', '−')
    mantissa, exponent = text.split('e')
    return f'{mantissa}·10<sup>{int(exponent)}</sup>'.replace('-', '−')


def value(name: str, amount: float, unit: str, digits: int = 3) -> str:
    """Return the parameter `name` in the unit in which it is read."""
    factor, read = OWN_UNITS.get(name, UNITS.get(unit, (1.0, unit)))
    return f'{number(factor * amount, digits)} {read}'.strip()


def interval(name: str, parameter: Mapping[str, Any]) -> tuple[str, str]:
    """Return value and 90 % interval of a parameter of diagnosis.json; empty where unknown.

    Both are written to two digits of the interval's width.
    """
    amount, unit = parameter['value'], parameter.get('unit', '')
    if isinstance(amount, str):
        return html.escape(amount), ''
    low, high = parameter.get('low'), parameter.get('high')
    if low is None or high is None or low == high:
        return value(name, amount, unit), ''
    factor, read = OWN_UNITS.get(name, UNITS.get(unit, (1.0, unit)))
    low, high = sorted((factor * low, factor * high))
    decimals = 1 - math.floor(math.log10(high - low))
    if decimals > 5:
        return value(name, amount, unit), f'{number(low)} … {number(high)} {read}'.strip()
    texts = [f'{part:.{max(decimals, 0)}f}'.replace('-', '−') for part in (low, high)]
    middle = f'{factor * amount:.{max(decimals, 0)}f} {read}'.replace('-', '−')
    return middle.strip(), f'{" … ".join(texts)} {read}'.strip()


def phrase(name: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Return what effect `name` with its `parameters` of diagnosis.json says about the rig."""
    values = {
        key: html.escape(entry['value']) if isinstance(entry['value'], str) else entry['value']
        for key, entry in parameters.items()
    }
    return PHRASES[name](values)


def _factor(amount: float, more: str, less: str) -> str:
    """Say how many per cent, or how many times, `amount` is `more` or `less`."""
    if not 0.5 < amount < 2.0:
        times = amount if amount > 1 else 1 / max(amount, 1e-9)
        return f'{number(times, 2)} times {more if amount > 1 else less}'
    return f'{number(100 * abs(amount - 1), 2)} % {more if amount >= 1 else less}'


def _way(amount: float, plus: str, minus: str, unit: str = 'mm', factor: float = 1e3) -> str:
    return f'{number(factor * abs(amount), 2)} {unit} {plus if amount >= 0 else minus}'


def _span(seconds: float) -> str:
    if seconds < 90:
        return f'{number(seconds, 2)} s'
    return f'{number(seconds / 60, 2)} min'


def _half_life(rate: float) -> str:
    if rate <= 0:
        return 'at no rate'
    return f'at {number(3600 * rate, 2)} per hour, half of it in {_span(math.log(2) / rate)}'


def _place(p: Values) -> str:
    return f'x = {p["x"]:.3f} m, z = {p["z"]:.3f} m'


def _dispersion(p: Values) -> str:
    if p['longitudinal_dispersivity'] > 0:
        return (
            'the tracer spreads on its way: dispersivity '
            f'{number(1e3 * p["longitudinal_dispersivity"], 2)} mm along the flow, '
            f'{number(1e3 * p["transverse_dispersivity"], 2)} mm across'
        )
    if p['diffusion'] < 1.05 * MOLECULAR_DIFFUSION:
        return 'the tracer spreads no more than by molecular diffusion'
    return (
        f'the tracer spreads as by a diffusion of {number(p["diffusion"], 2)} m²/s, '
        f'{number(p["diffusion"] / MOLECULAR_DIFFUSION, 2)} times the molecular one'
    )


def _heterogeneity(p: Values) -> str:
    more = _factor(p['permeability_factor'], 'more', 'less')
    return (
        f'a zone of {number(1e3 * p["radius"], 2)} mm radius at {_place(p)} '
        f'is {more} permeable than believed'
    )


def _leak(p: Values) -> str:
    came = 'water enters' if p['rate'] > 0 else 'water is lost'
    return f'{came} at {_place(p)}: {number(abs(p["rate"]), 2)} ml/h'


def _registration(p: Values) -> str:
    turned = _way(p['rotation'], 'counter-clockwise', 'clockwise', 'degrees', 180 / math.pi)
    return (
        f'the picture is shifted {_way(p["dx"], "right", "left")} and {_way(p["dz"], "up", "down")}'
        f', turned {turned}, and {_factor(p["scale"], "too large", "too small")}'
    )


def _illumination(p: Values) -> str:
    return (
        f'the tracer’s signal {"grows" if p["drift"] >= 0 else "falls"} by '
        f'{number(3.6e5 * abs(p["drift"]), 2)} %/h, and is '
        f'{_way(p["gradient"], "stronger", "weaker", "% per 10 cm", 10)} to the right'
    )


def _clock(p: Values) -> str:
    late = 'earlier' if p['offset'] < 0 else 'later'
    return (
        f'a photograph shows the rig {_span(abs(p["offset"]))} {late} than its stamp says '
        'by the pumps’ clock'
    )


def _background(p: Values) -> str:
    return (
        'water flows through the whole rig beside the wells: a Darcy flux of '
        f'{_way(p["x_velocity"], "right", "left", "mm/h", 3.6e6)} and '
        f'{_way(p["z_velocity"], "up", "down", "mm/h", 3.6e6)}'
    )


PHRASES: dict[str, Callable[[Values], str]] = {
    'numerical_diffusion': lambda p: (
        'the model itself smears, as by a diffusion of '
        f'{number(p["model_diffusion"], 2)} m²/s; a sharper scheme closes the gap'
    ),
    'dispersion': _dispersion,
    'buoyancy': lambda p: (
        f'the tracer is {_way(p["density_difference"], "denser", "lighter", "kg/m³", 1)} than water'
    ),
    'viscosity': lambda p: (
        f'the tracer is {_factor(p["viscosity_ratio"], "more", "less")} viscous than water'
    ),
    'retardation': lambda p: (
        'the tracer sorbs to the sand and travels at '
        f'{number(100 / p["retardation_factor"], 4)} % of the water’s speed'
    ),
    'decay': lambda p: f'the tracer fades or is lost {_half_life(p["rate"])}',
    'dual_porosity': lambda p: (
        f'{number(100 * p["immobile_fraction"], 2)} % of the pore water stand still and exchange '
        f'tracer with the rest within {_span(1 / p["exchange_rate"])}'
    ),
    'heterogeneity': _heterogeneity,
    'porosity': lambda p: (
        f'the porosity is {_factor(p["factor"], "higher", "lower")} than believed'
    ),
    'depth': lambda p: (
        'the plates stand '
        f'{_factor(p["factor_centre"], "further apart", "closer together")} in the middle'
    ),
    'rate': lambda p: (
        f'pump {p["well"]} delivers {number(100 * p["factor"], 3)} % of what it is told'
    ),
    'well_position': lambda p: (
        f'well {p["well"]} opens {_way(p["dx"], "to the right of", "to the left of")} and '
        f'{_way(p["dz"], "above", "below")} its believed place'
    ),
    'leak': _leak,
    'background_flow': _background,
    'saturation': lambda p: (
        f'the camera’s signal is the concentration to the power of {number(p["exponent"])}'
    ),
    'illumination': _illumination,
    'registration': _registration,
    'clock': _clock,
}
"""What each effect says, by name."""
