"""A toy rig, its linear physics-based model and a sharper truth, in a few lines of their own."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch

from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Boundaries, Rig, Well
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, WellRate, WellRates
from porotwin_costa.dataset import Frames
from porotwin_costa.flow_shape import flow_shape_of

TIME_STEP = 30.0


@pytest.fixture(autouse=True, scope='session')
def _one_thread() -> None:
    """Let torch use one thread: repeatable on every machine, and kind to others."""
    torch.set_num_threads(1)


def injecting(**rates_ml_h: float) -> dict[str, WellRate]:
    """Return tracer injection into the named wells, balanced by the producer."""
    rates = {name: WellRate(from_ml_h(rate), 1.0) for name, rate in rates_ml_h.items()}
    return {**rates, 'producer': WellRate(-from_ml_h(sum(rates_ml_h.values())))}


@dataclass
class ToyModel:
    """Upwind advection in homogeneous sand: linear, over-diffusive, explicit in inner steps.

    phi (c^(n+1) - P c^n) / dt = sigma with P the inner steps, as the twin's own model understands
    L c = f_c + sigma.
    """

    rig: Rig
    grid: Grid
    sharp: bool = False

    def __post_init__(self) -> None:
        self.wells = tuple(self.rig.wells)
        self.flow = flow_shape_of(self.rig, self.grid, self.wells)
        self.pore_volume = 0.375 * self.grid.cell_area * 0.010

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        pumped = np.array([rates[name].rate if name in rates else 0.0 for name in self.wells])
        right = np.tensordot(pumped, self.flow.right, 1)
        up = np.tensordot(pumped, self.flow.up, 1)
        injected, produced = np.zeros(self.grid.shape), np.zeros(self.grid.shape)
        for name, well in rates.items():
            place = self.rig.wells[name]
            cell = int(place.z_m / self.grid.dz), int(place.x_m / self.grid.dx)
            injected[cell] += max(well.rate, 0.0) * well.concentration
            produced[cell] += max(-well.rate, 0.0)
        fastest = max(np.abs(right).max(), np.abs(up).max(), produced.max())
        steps = int(np.ceil(4 * fastest * time_step / self.pore_volume)) + 1
        current = concentration.copy()
        for _ in range(steps):
            change = injected - produced * current
            across = self._carried(current, right, 1) * right
            along = self._carried(current, up, 0) * up
            change[:, :-1] -= across
            change[:, 1:] += across
            change[:-1] -= along
            change[1:] += along
            current = current + change * (time_step / steps / self.pore_volume)
        return current

    def _carried(self, c: FloatArray, flow: FloatArray, axis: int) -> FloatArray:
        ahead = np.moveaxis(c, axis, 0)
        jump = np.diff(ahead, axis=0)
        slope = np.zeros_like(ahead)
        if self.sharp:
            product = jump[1:] * jump[:-1]
            total = np.where(product > 0, jump[1:] + jump[:-1], 1.0)
            slope[1:-1] = np.where(product > 0, 2 * product / total, 0.0)
        towards = np.moveaxis(flow, axis, 0) > 0
        value = np.where(towards, ahead[:-1] + slope[:-1] / 2, ahead[1:] - slope[1:] / 2)
        return np.moveaxis(value, 0, axis)

    def residual(
        self, previous: FloatArray, next_: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        return 0.375 * (next_ - self.predict(previous, rates, time_step)) / time_step

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        return self.predict(previous, rates, time_step) + time_step * sigma / 0.375


@pytest.fixture(scope='session')
def rig() -> Rig:
    return Rig(
        name='toy',
        width_m=0.6,
        height_m=0.4,
        depth_m=0.010,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1e-3,
        density_kg_m3=998.0,
        boundaries=Boundaries(top='closed'),
        wells={
            'left': Well(x_m=0.15, z_m=0.15),
            'right': Well(x_m=0.42, z_m=0.28),
            'producer': Well(x_m=0.5, z_m=0.08),
        },
    )


@pytest.fixture(scope='session')
def grid(rig: Rig) -> Grid:
    return rig.grid(30, 20)


@pytest.fixture(scope='session')
def model(rig: Rig, grid: Grid) -> ToyModel:
    return ToyModel(rig, grid)


@pytest.fixture(scope='session')
def observe(rig: Rig, grid: Grid):
    """Return a function that lets the sharp truth run a schedule and photographs it."""
    truth = ToyModel(rig, grid, sharp=True)

    def run(schedule: Schedule, count: int, name: str = 'experiment') -> Frames:
        times = np.arange(count) * TIME_STEP
        frames = [np.zeros(grid.shape)]
        for time in times[:-1]:
            frames.append(truth.predict(frames[-1], schedule.at(time), TIME_STEP))
        return Frames(times, np.array(frames), schedule, name=name)

    return run


@pytest.fixture(scope='session')
def training_frames(observe) -> list[Frames]:
    return [
        observe(Schedule.constant(injecting(left=400.0)), 25, 'left'),
        observe(Schedule.constant(injecting(right=500.0)), 25, 'right'),
    ]


@pytest.fixture(scope='session')
def judging_frames(observe) -> Frames:
    """Return a third experiment, which training keeps aside."""
    return observe(Schedule.constant(injecting(left=200.0, right=200.0)), 15, 'both')


@pytest.fixture(scope='session')
def unseen_frames(observe) -> Frames:
    told = [(0.0, injecting(left=300.0, right=100.0)), (300.0, injecting(left=50.0, right=350.0))]
    return observe(Schedule.from_rates(told), 25, 'unseen')
