"""Recordings that tests share, made by the virtual rig, whose numerics are not the solver's."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from porotwin_core.grid import Grid
from porotwin_core.rig import EffectDescription
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.model.candidate import Candidate, FitParameter
from porotwin_diagnosis.model.fit import Fit
from porotwin_recording.concentration import ConcentrationMaps
from porotwin_recording.recording import Recording
from porotwin_rig.experiment import make_experiment
from porotwin_rig.observation import MapNoise
from porotwin_validation.blind_cases import SMALL

COSTLY = ('buoyancy', 'viscosity', 'dual_porosity', 'background_flow', 'heterogeneity', 'leak')
"""Effects that take most of the time of a search; tests of other effects leave them out."""

BESIDE_THE_POINT = (*COSTLY, 'well_position', 'registration', 'illumination', 'decay')
"""Effects that take most of the remaining time too; tests with several searches leave them out."""


def schedule():
    """Inject for 25 min beside a control well, rest for 5, inject again."""
    return commanded(
        (0, 'injector', 450, 1.0),
        (0, 'control2', 150, 0.0),
        (0, 'producer', -500, 0.0),
        (1500, 'injector', 0, 1.0),
        (1800, 'injector', 450, 1.0),
    )


def recorded(
    folder: Path,
    *effects: EffectDescription,
    seed: int = 3,
    told: Schedule | None = None,
    duration: float = 2700,
    grid: Grid | None = None,
) -> Path:
    """Make a recording on a coarse grid with ordinary noise and hidden `effects`."""
    make_experiment(
        folder,
        SMALL,
        told=told or schedule(),
        duration=duration,
        photo_interval=90,
        seed=seed,
        effects=effects,
        noise=MapNoise.drawn(seed),
        grid=grid or SMALL.grid(94, 56),
    )
    return folder


def commanded(*rows: tuple[float, str, float, float]) -> Schedule:
    """Return the schedule of rows (time [s], well, rate [ml/h], concentration)."""
    return Schedule(
        tuple(
            ScheduleRow(float(time), well, WellRate(from_ml_h(rate), c))
            for time, well, rate, c in rows
        )
    )


DENSER = EffectDescription(name='porosity', parameters={'factor': 0.88})
"""A porosity 12 % lower than the nominal one."""

CHASE = commanded(
    (0, 'injector', 400, 1.0),
    (900, 'injector', 0, 1.0),
    (900, 'control2', 400, 0.0),
    (900, 'producer', -300, 0.0),
)
"""Tracer, then water from another well, which drives the tracer on."""


def with_frames(recording: Recording, times: np.ndarray, maps: np.ndarray) -> Recording:
    """Return `recording` with other frames: `maps` (nt, nz, nx) at `times` [s]."""
    series = ConcentrationMaps(times, recording.grid, lambda start, stop: maps[start:stop])
    return replace(recording, maps=series)


def fit_of(*effects: str, misfit: float, held_out: float | None = None, error=0.1, **others) -> Fit:
    """Return a fit of `effects`, with one parameter each, that has these misfits."""
    members = tuple(Candidate(name, (FitParameter('value', '-', 1.0, 0.1),)) for name in effects)
    size = len(members)
    held_out = held_out or misfit
    unknown = np.zeros((size, size))
    return Fit(members, np.ones(size), misfit, held_out, 0.1, error, unknown, **others)
