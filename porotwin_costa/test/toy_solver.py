"""A solver of learnt physics for the tests: tracer that moves to the right, more or less slowly."""

import math
from dataclasses import dataclass

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import EffectDescription
from porotwin_costa.data.frames import Frames

STEP_S = 30.0
SPEED = 0.4
POROSITY = 0.375


@dataclass(frozen=True)
class MovingTracer:
    """c moves by `speed` cells to the right in STEP_S; linear, so that its adjoint is simple."""

    speed: float = SPEED

    def predict(self, concentration: FloatArray, _rates: WellRates, time_step: float) -> FloatArray:
        share = self.speed * time_step / STEP_S
        return (1.0 - share) * concentration + share * np.roll(concentration, 1, axis=1)

    def step_adjoint(
        self, _previous: FloatArray, _rates: WellRates, time_step: float, bar: FloatArray
    ) -> FloatArray:
        share = self.speed * time_step / STEP_S
        return (1.0 - share) * bar + share * np.roll(bar, -1, axis=1)

    def source_of(self, change: FloatArray, time_step: float) -> FloatArray:
        return POROSITY * change / time_step

    def residual(
        self, previous: FloatArray, next_: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        return self.source_of(next_ - self.predict(previous, rates, time_step), time_step)

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        return self.predict(previous, rates, time_step) + time_step * sigma / POROSITY


def delayed(factor: float) -> LearntPhysics:
    """Return learnt physics with this factor on the retardation."""
    return LearntPhysics(
        (EffectDescription(name='retardation', parameters={'retardation_factor': factor}),)
    )


def delay(learnt: LearntPhysics) -> float:
    """Return the factor of all `learnt` retardation."""
    factors = [float(one.parameters.get('retardation_factor', 1.0)) for one in learnt.effects]
    return math.prod(factors)


@dataclass(frozen=True)
class MovingTracers:
    """A `LearntSolver`: retardation slows the tracer down, other physics does nothing.

    Any named scheme moves it by the true SPEED.
    """

    speed: float = SPEED

    def model(self, learnt: LearntPhysics) -> MovingTracer:
        speed = SPEED if learnt.scheme else self.speed
        return MovingTracer(speed / delay(learnt))


def moving_frames(grid: Grid, count: int, *, speed: float = SPEED, at: float = 0.2) -> Frames:
    """Return `count` maps of a round plume that starts at the share `at` of the width."""
    x, z = np.meshgrid(grid.x / grid.width, grid.z / grid.height)
    state = np.exp(-((x - at) ** 2 + (z - 0.5) ** 2) / 0.02)
    model, maps = MovingTracer(speed), [state]
    for _ in range(count - 1):
        maps.append(model.predict(maps[-1], {}, STEP_S))
    return Frames(STEP_S * np.arange(count), np.array(maps), Schedule(), name=f'plume at {at}')
