"""Boundaries, maps and rigs that several tests of the solver share."""

import numpy as np

from porotwin_core.rig import Boundaries, Rig, Well, rig_from_maps

SIDES = {
    'open top': Boundaries(),
    'closed': Boundaries(top='closed'),
    'open': Boundaries(top='open', bottom='open', left='open', right='open'),
}


def rough_map(shape: tuple[int, int], seed: int) -> np.ndarray:
    """Return values between 0 and 1 with plateaus, jumps and noise, (nz, nx) = `shape`."""
    rng = np.random.default_rng(seed)
    return np.clip(rng.normal(0.5, 0.8, shape), 0.0, 1.0)


def with_permeability(rig: Rig, values: np.ndarray) -> Rig:
    """Return `rig` with a permeability map [m^2], (nz, nx)."""
    quantities = {
        'depth_m': rig.nominal_map('depth_m'),
        'porosity': rig.nominal_map('porosity'),
        'permeability_m2': values,
    }
    return rig_from_maps(rig.model_dump(), quantities)


def two_well_rig() -> Rig:
    """Return a rig half as wide as the paper's small one, with an injector and a producer."""
    return Rig(
        name='two wells',
        width_m=0.5,
        height_m=0.3,
        depth_m=0.010,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1e-3,
        density_kg_m3=998.0,
        boundaries=Boundaries(),
        wells={'injector': Well(x_m=0.15, z_m=0.12), 'producer': Well(x_m=0.4, z_m=0.1)},
    )
