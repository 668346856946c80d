"""A toy rig, its linear physics-based model and a less diffusive truth, for the tests of COSTA."""

from dataclasses import dataclass

import numpy as np
import torch

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import Boundaries, Rig, Well
from porotwin_costa.data.dataset import Dataset
from porotwin_costa.data.flow_shape import flow_shape_of, homogeneous_flow
from porotwin_costa.networks import RigFields, architecture

NETWORKS = {
    'paper': architecture('paper').described(
        {'convolution_pool_layers': 2, 'convolution_layers': 1, 'filters': 4}
    ),
    'local': architecture('local').described({'filters': 4}),
}

TIME_STEP = 30.0
"""Time between two photographs [s]."""

POROSITY = 0.375
DEPTH_M = 0.010


def toy_rig() -> Rig:
    """Return a small closed rig with two injectors and a producer."""
    return Rig(
        name='toy',
        width_m=0.6,
        height_m=0.4,
        depth_m=DEPTH_M,
        porosity=POROSITY,
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


def injecting(**rates_ml_h: float) -> dict[str, WellRate]:
    """Return tracer injection into the named wells, balanced by the producer."""
    rates = {name: WellRate(from_ml_h(rate), 1.0) for name, rate in rates_ml_h.items()}
    return {**rates, 'producer': WellRate(-from_ml_h(sum(rates_ml_h.values())))}


@dataclass
class ToyModel:
    """Upwind advection in homogeneous sand: linear, too diffusive, explicit in inner time steps.

    phi (c^(n+1) - P c^n) / dt = sigma, where P are the inner steps. The twin's own model has the
    same meaning of L c = f_c + sigma. With `sharp` the scheme is a limited one of second order.
    """

    rig: Rig
    grid: Grid
    sharp: bool = False

    def __post_init__(self) -> None:
        self.wells = tuple(self.rig.wells)
        self.flow = flow_shape_of(self.rig, self.grid, self.wells)
        self.pore_volume = POROSITY * self.grid.cell_area * DEPTH_M

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
            across = self._face_values(current, right, 1) * right
            along = self._face_values(current, up, 0) * up
            change[:, :-1] -= across
            change[:, 1:] += across
            change[:-1] -= along
            change[1:] += along
            current = current + change * (time_step / steps / self.pore_volume)
        return current

    def _face_values(self, c: FloatArray, flow: FloatArray, axis: int) -> FloatArray:
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
        return POROSITY * (next_ - self.predict(previous, rates, time_step)) / time_step

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        return self.predict(previous, rates, time_step) + time_step * sigma / POROSITY


def question(dataset: Dataset, sample: int = 12) -> tuple[FloatArray, dict[str, WellRate], float]:
    """Return prediction, rates and time step of a sample, as `corrective_source` takes them."""
    rates = {
        name: WellRate(water, tracer / water if water > 0 else 0.0)
        for name, (water, tracer) in zip(dataset.wells, dataset.rates[sample], strict=True)
    }
    return dataset.predicted[sample].astype(float), rates, dataset.time_step


def rig_fields(
    nx: int, nz: int, *, change: float = 0.0, boundaries: Boundaries | None = None
) -> RigFields:
    """Return a rig of even depth with three wells, on a grid of `nx` columns and `nz` rows."""
    wells = {'injector': (0.2, 0.2), 'control': (0.5, 0.4), 'producer': (0.7, 0.16)}
    grid = Grid(nx, nz, 0.934, 0.562)
    flow = homogeneous_flow(grid, wells, boundaries or Boundaries())
    return RigFields(grid.shape, len(wells), flow, np.full(grid.shape, change), np.ones(grid.shape))


def scaled_rates(samples: int) -> torch.Tensor:
    """Return scaled rates for the wells of `rig_fields`, the same for each sample."""
    return torch.tensor([[1.0, 1.0, 0.5, 0.0, -1.5, 0.0]]).repeat(samples, 1)
