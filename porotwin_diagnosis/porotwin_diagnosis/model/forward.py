"""Predictions of a recording with any effects, simulating no more often than needed."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from threading import Lock

import numpy as np

from porotwin_core.grid import FloatArray, conservative_resample
from porotwin_core.rig import EffectDescription, rig_from_maps
from porotwin_diagnosis.data.sample import Sample
from porotwin_solver.effects import EFFECTS, apply_effects
from porotwin_solver.observation_operator import ObservationOperator
from porotwin_solver.physics import nominal_physics
from porotwin_solver.simulation import simulated_maps

REMEMBERED = 40
"""Simulations kept; effects of the camera and repeated questions then cost nothing."""

ROUGHNESS = 0.05
"""By how much, as a standard deviation of its logarithm, the permeability of a recorded cell may
differ from what is believed without anybody knowing: what 1 % of the porosity makes of it by
Kozeny and Carman (Bear, Dynamics of Fluids in Porous Media, sec. 5.10)."""


class Forward:
    """Free-running predictions of one recording at its chosen frames, as the camera shows them."""

    def __init__(
        self, sample: Sample, *, preset: str = 'fast', refinement: int | None = None
    ) -> None:
        """Predict `sample` with the solver's `preset`, on cells `refinement` times finer, as the
        preset has it where that is not given."""
        self.sample = sample
        self.preset = preset
        self.refinement = refinement
        self.runs = 0
        self.offset: FloatArray | None = None
        self._known: OrderedDict[str, FloatArray] = OrderedDict()
        self._lock = Lock()

    def maps(
        self, effects: Sequence[EffectDescription], *, fitted_only: bool = False
    ) -> FloatArray:
        """Return the maps (nt, nz, nx) that the camera would show with `effects`, without noise.

        With `fitted_only` those of the fitted frames, for less.
        """
        physics = tuple(effect for effect in effects if EFFECTS[effect.name].needs_simulation)
        image = [effect for effect in effects if not EFFECTS[effect.name].needs_simulation]
        maps = self._simulated(physics, fitted_only=fitted_only)
        if self.offset is not None:
            maps = np.clip(maps + self.offset[: len(maps)], 0.0, 1.0)
        if not image:
            return maps
        sample = self.sample
        _, operator = apply_effects(
            nominal_physics(sample.rig, sample.grid), ObservationOperator(), image
        )
        return np.stack(
            [
                operator.apply(frame, sample.grid, float(time))
                for frame, time in zip(maps, sample.times, strict=False)
            ]
        )

    def lean_on(
        self,
        finer: 'Forward',
        effects: Sequence[EffectDescription] = (),
        *,
        extrapolation: float = 1.0,
    ) -> None:
        """From now on add what `finer` cells change in the maps with `effects`, `extrapolation`
        times.

        What a coarse grid does wrong is nearly the same wherever fronts lie nearly the same.
        """
        shape = self.sample.grid.shape
        physics = [effect for effect in effects if EFFECTS[effect.name].needs_simulation]
        sharp = [conservative_resample(frame, shape) for frame in finer.maps(physics)]
        self.offset = None
        self.offset = extrapolation * (np.stack(sharp) - self.maps(physics))

    def _simulated(
        self, physics: tuple[EffectDescription, ...], *, fitted_only: bool
    ) -> FloatArray:
        key, sample = repr(physics), self.sample
        wanted = sample.fitted if fitted_only else len(sample.times)
        with self._lock:
            if key in self._known and len(self._known[key]) >= wanted:
                self._known.move_to_end(key)
                return self._known[key][:wanted]
            self.runs += 1
        frames = simulated_maps(
            sample.rig,
            sample.schedule,
            sample.times[:wanted],
            grid=sample.grid,
            preset=self.preset,
            effects=physics,
            initial=sample.initial,
            start=sample.model_start,
            refinement=self.refinement,
        )
        maps = np.stack([frame.astype(np.float32) for frame in frames])
        with self._lock:
            self._known[key] = maps
            while len(self._known) > REMEMBERED:
                self._known.popitem(last=False)
        return maps


def on_rough_sand(sample: Sample, seed: int) -> Sample:
    """Return `sample` on sand whose permeability varies from cell to cell as nobody can know."""
    rig, grid = sample.rig, sample.grid.refined(2)
    texture = np.random.default_rng(seed).normal(0.0, ROUGHNESS, sample.grid.shape)
    rough = rig.field('permeability_m2', grid) * np.exp(np.kron(texture, np.ones((2, 2))))
    quantities = {
        'depth_m': rig.nominal_map('depth_m'),
        'porosity': rig.nominal_map('porosity'),
        'permeability_m2': rough,
    }
    return replace(sample, rig=rig_from_maps(rig.model_dump(), quantities))
