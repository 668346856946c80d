"""Rigs that the tests of the virtual rig share."""

from pathlib import Path
from typing import Any

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig, parse_rig

SMALL = {
    'name': 'small',
    'width_m': 0.934,
    'height_m': 0.562,
    'depth_m': 0.010,
    'porosity': 0.375,
    'permeability_m2': 6.57e-10,
    'viscosity_pa_s': 1.0e-3,
    'density_kg_m3': 998.0,
    'boundaries': {'top': 'open', 'bottom': 'closed', 'left': 'closed', 'right': 'closed'},
    'wells': {
        'injector': {'x_m': 0.235, 'z_m': 0.235},
        'producer': {'x_m': 0.660, 'z_m': 0.160},
        'control1': {'x_m': 0.120, 'z_m': 0.420},
        'control2': {'x_m': 0.500, 'z_m': 0.375},
        'control3': {'x_m': 0.760, 'z_m': 0.460},
    },
    'control': {
        'wells': ['control1', 'control2', 'control3'],
        'producer': 'producer',
        'fixed': {'injector': {'rate_ml_h': 500.0, 'concentration': 1.0}},
        'disallowed_zone_m': [[0.0, 0.4], [0.9, 0.4], [0.9, 0.56], [0.0, 0.56]],
    },
}


def make_rig(**changes: Any) -> Rig:
    """Return the small rig with some keys changed."""
    return parse_rig({**SMALL, **changes}, Path('rig.yaml'))


def rates(**ml_h: float | tuple[float, float]) -> dict[str, WellRate]:
    """Return rates by well from ml/h, or from (ml/h, concentration)."""
    pairs = {name: v if isinstance(v, tuple) else (v, 0.0) for name, v in ml_h.items()}
    return {name: WellRate(from_ml_h(rate), c) for name, (rate, c) in pairs.items()}
