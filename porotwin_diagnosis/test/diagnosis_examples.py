"""Recordings that the tests share: made by the virtual rig, whose numerics are not the solver's."""

from pathlib import Path

import numpy as np

from porotwin_core.grid import Grid
from porotwin_core.rig import EffectDescription
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.model.fit import Fit
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.map_camera import MapNoise
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter
from porotwin_validation.blind_cases import SMALL

COSTLY = ('buoyancy', 'viscosity', 'dual_porosity', 'background_flow', 'heterogeneity', 'leak')
"""Effects that take most of a search; a test whose point is another one leaves them out."""

BESIDE_THE_POINT = (*COSTLY, 'well_position', 'registration', 'illumination', 'decay')
"""And those that take most of the rest, for a test of more than one search."""


def schedule():
    """Inject for 25 min beside a control well, rest for 5, inject again."""
    rows = [
        (0, 'injector', 450, 1.0),
        (0, 'control2', 150, 0.0),
        (0, 'producer', -500, 0.0),
        (1500, 'injector', 0, 1.0),
        (1800, 'injector', 450, 1.0),
    ]
    return Schedule(
        tuple(
            ScheduleRow(float(t), well, WellRate(from_ml_h(rate), c)) for t, well, rate, c in rows
        )
    )


def recorded(
    folder: Path,
    *effects: EffectDescription,
    seed: int = 3,
    told: Schedule | None = None,
    duration: float = 2700,
    grid: Grid | None = None,
) -> Path:
    """Make a recording on a coarse grid with ordinary noise and sealed `effects`."""
    make_experiment(
        folder,
        SMALL,
        commanded=told or schedule(),
        duration=duration,
        photo_interval=90,
        seed=seed,
        effects=effects,
        noise=MapNoise.drawn(seed),
        grid=grid or SMALL.grid(94, 56),
    )
    return folder


def fit_of(*effects: str, misfit: float, held_out: float | None = None, error=0.1, **others) -> Fit:
    """Return a fit of `effects`, of one parameter each, as if it had been judged so."""
    members = tuple(Candidate(name, (FitParameter('value', '-', 1.0, 0.1),)) for name in effects)
    size = len(members)
    held_out = held_out or misfit
    unknown = np.zeros((size, size))
    return Fit(members, np.ones(size), misfit, held_out, 0.1, error, unknown, **others)
