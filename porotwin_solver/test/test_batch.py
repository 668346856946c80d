"""A batch of simulations equals single simulations, on any number of threads."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription
from porotwin_solver.model.batch import Job, simulate_many
from porotwin_solver.model.simulation import simulate

TIMES = (0.0, 60.0, 120.0)


def jobs(rig, rates) -> list[Job]:
    """Return simulations with different porosities."""
    return [
        Job(
            rig,
            Schedule.constant(rates),
            TIMES,
            rig.grid(31, 19),
            'fast',
            (EffectDescription(name='porosity', parameters={'factor': factor}),),
        )
        for factor in (0.8, 0.9, 1.0, 1.1)
    ]


def alone(job: Job) -> np.ndarray:
    return simulate(
        job.rig, job.schedule, job.times, grid=job.grid, preset=job.preset, effects=job.effects
    )


def test_a_batch_equals_single_simulations_in_their_order(rig, rates) -> None:
    many = simulate_many(jobs(rig, rates), workers=2)
    for job, found in zip(jobs(rig, rates), many, strict=True):
        np.testing.assert_array_equal(found, alone(job))


def test_a_refused_job_gives_its_reason(rig, rates) -> None:
    bad = Job(rig, Schedule.constant(rates), TIMES, rig.grid(31, 19), 'quick')
    with pytest.raises(InputError, match="preset 'quick': unknown"):
        simulate_many([*jobs(rig, rates), bad])
