"""Compiles the numerical kernels once, so that no node compiles while a photograph waits.

`python -m porotwin_cli.kernels` is a step of the setup. It runs small examples of everything. Numba
keeps the results beside the sources and compiles changed functions again by itself.
"""

import numpy as np

from porotwin_cli.workspace import small_rig
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.effect_limits import MOST_DIFFUSION
from porotwin_core.rates.wells import RateStep, Schedule
from porotwin_core.rig import load_rig
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_rig.camera import camera_before
from porotwin_rig.render import Photographer
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.adjoint.schedule_cost import schedule_cost
from porotwin_solver.effects.dispersion import EFFECT as DISPERSION
from porotwin_solver.effects.viscosity import EFFECT as VISCOSITY
from porotwin_solver.model.engine import LONGEST_STEP
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import PRESETS
from porotwin_solver.model.simulation import simulate

COLUMNS, ROWS = 47, 28
"""A coarse grid of the small rig: kernels compile for types, not for sizes."""

MENDED = (
    VISCOSITY.described(viscosity_ratio=1.1),
    DISPERSION.described(longitudinal_dispersivity=1e-3, transverse_dispersivity=1e-4),
)
"""Effects with kernels of their own, which a running twin may take over."""

STRONG = (
    DISPERSION.described(
        longitudinal_dispersivity=1e-3, transverse_dispersivity=1e-4, diffusion=MOST_DIFFUSION
    ),
)
"""Dispersion that is exchanged along lines of cells."""

PHOTO_WIDTH_PX = 400
"""The smallest photograph that the virtual camera takes."""


def compile_kernels() -> None:
    """Run every kernel that the demo and a live graph use."""
    rig = load_rig(small_rig())
    safe = Limits.of(rig).safe()
    grid = rig.grid(COLUMNS, ROWS)
    for preset in PRESETS:
        simulate(rig, Schedule.constant(safe), [0.0, 1.0], grid=grid, preset=preset)
    for effects, horizon in ((MENDED, 1.0), (STRONG, LONGEST_STEP)):
        model = Model(rig, grid, effects=effects)
        term = CostTerm(0.0, horizon, linear=np.ones(grid.shape))
        plan = [RateStep(0.0, safe)]
        schedule_cost(model, np.zeros(grid.shape), plan, horizon=horizon, terms=[term])
    asset = VirtualRig(rig)
    asset.set_rates(safe)
    asset.advance(1.0)
    photographer = Photographer(rig, camera=camera_before(rig, PHOTO_WIDTH_PX), seed=1)
    baseline = make_baseline(photographer.rig, grid, [photographer.baseline()])
    concentration_map(photographer.photograph(asset.concentration(grid), time=1.0), baseline)


if __name__ == '__main__':
    compile_kernels()
