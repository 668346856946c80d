"""Compiles the numerical kernels once, so that no node compiles while a photograph waits.

`python -m porotwin_cli.kernels`, a step of the setup. What it runs is small; numba keeps the result
beside the sources and compiles again by itself what changes.
"""

from porotwin_cli.workspace import small_rig
from porotwin_core.rig import load_rig
from porotwin_core.wells import Schedule
from porotwin_hub.control import Limits
from porotwin_imaging.chain import Imaging
from porotwin_rig.camera import camera_before
from porotwin_rig.render import Photographer
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model import PRESETS
from porotwin_solver.simulation import simulate


def compile_kernels() -> None:
    """Use every kernel that the demo and a live graph use."""
    rig = load_rig(small_rig())
    safe = Limits.of(rig).safe()
    grid = rig.grid(47, 28)
    for preset in PRESETS:
        simulate(rig, Schedule.constant(safe), [0.0, 1.0], grid=grid, preset=preset)
    asset = VirtualRig(rig)
    asset.set_rates(safe)
    asset.advance(1.0)
    photographer = Photographer(rig, camera=camera_before(rig, 400), seed=1)
    imaging = Imaging(photographer.rig, grid)
    imaging.set_baselines([photographer.baseline()])
    imaging.concentration(photographer.photograph(asset.concentration(grid), time=1.0))


if __name__ == '__main__':
    compile_kernels()
