"""Measures the influence of unknown small-scale heterogeneity on a prediction.

A tracer less viscous than water displaces water in fingers, and a dense one sinks into it in
fingers. Their places depend on unknown details of the sand (Saffman & Taylor, Proc. R. Soc. A 245
(1958) 312). Such a model may leave a larger misfit. Simulations on sands with random permeability
measure the allowed factor.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import EffectDescription, rig_from_maps
from porotwin_diagnosis.data.misfit import misfit
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.model.effect_traits import destabilises_fronts
from porotwin_diagnosis.model.forward import Effects, Forward, SimulationMemory, whitened_residuals

ROUGHNESS = 0.05
"""Standard deviation [-] of the logarithm of the permeability from cell to cell. A variation of the
porosity by 1 % makes that much by the relation of Kozeny and Carman (Bear, Dynamics of Fluids in
Porous Media, section 5.10)."""


def on_rough_sand(sample: Sample, seed: int) -> Sample:
    """Return `sample` on sand whose permeability varies at random from cell to cell.

    The logarithm of the permeability is normally distributed about its nominal value with the
    standard deviation `ROUGHNESS`; the same `seed` makes the same sand.
    """
    rig, grid = sample.rig, sample.grid.refined(2)
    texture = np.random.default_rng(seed).normal(0.0, ROUGHNESS, sample.grid.shape)
    rough = rig.field('permeability_m2', grid) * np.exp(np.kron(texture, np.ones((2, 2))))
    quantities = {
        'depth_m': rig.nominal_map('depth_m'),
        'porosity': rig.nominal_map('porosity'),
        'permeability_m2': rough,
    }
    return replace(sample, rig=rig_from_maps(rig.model_dump(), quantities))


class RoughSands:
    """Forward models of the same recordings on rough sands, and the responses measured on them.

    A response is measured once per set of effects, with the correction and the point spread of that
    moment. It is then kept: later corrections change it little, and a second measurement would
    cost two simulations per sand and recording.
    """

    def __init__(self, sands: Sequence[Sequence[Forward]] = ()) -> None:
        """Use `sands`: for every rough sand one forward model per recording."""
        self._sands = sands
        self._responses: dict[str, FloatArray] = {}

    def fingering_amplification(
        self, forwards: Sequence[Forward], effects: Effects
    ) -> tuple[float, float]:
        """Return the ratio of the responses to rough sand with and without fingers, at least 1.

        The response is the misfit between the predictions on rough and on smooth sand, as a root
        mean square over the sands: with `effects` and those of rig.yaml, over that of a rig without
        any effect that destabilises fronts.

        Args:
            forwards: one forward model per recording, on smooth sand.
            effects: effects of the rig and of the camera.

        Returns:
            The ratio for the fitted and for the held-out frames; 1 if fronts are stable.

        Raises:
            InputError: the model cannot run with these effects.
        """
        described = forwards[0].sample.rig.effects
        if not self._sands or not destabilises_fronts((*described, *effects)):
            return 1.0, 1.0
        with_effects = self._response(forwards, effects)
        without = self._response([*map(_with_stable_fronts, forwards)], ())
        fitted, held_out = np.maximum(with_effects / np.maximum(without, SMALLEST_DIVISOR), 1.0)
        return float(fitted), float(held_out)

    def _response(self, forwards: Sequence[Forward], effects: Effects) -> FloatArray:
        key = repr((effects, forwards[0].sample.rig.effects))
        if key not in self._responses:
            self._responses[key] = self._measured(forwards, effects)
        return self._responses[key]

    def _measured(self, forwards: Sequence[Forward], effects: Effects) -> FloatArray:
        """Return the response (2,) [-]: fitted, held out."""
        smooth = whitened_residuals(forwards, effects)
        squares = np.zeros(2)
        described = forwards[0].sample.rig.effects
        for sand in self._sands:
            rough_models = [
                replace(
                    _with_described(rough, described),
                    correction=forward.correction,
                    point_spread_width=forward.point_spread_width,
                )
                for rough, forward in zip(sand, forwards, strict=True)
            ]
            rough = whitened_residuals(rough_models, effects)
            changes = [there - here for there, here in zip(rough, smooth, strict=True)]
            squares += np.square(misfit([forward.sample for forward in forwards], changes))
        return np.sqrt(squares / len(self._sands))


def _with_stable_fronts(forward: Forward) -> Forward:
    """Return `forward` without the effects of its rig that destabilise fronts."""
    described = forward.sample.rig.effects
    return _with_described(
        forward, tuple(effect for effect in described if not destabilises_fronts([effect]))
    )


def _with_described(forward: Forward, effects: tuple[EffectDescription, ...]) -> Forward:
    """Return `forward` with other effects of its rig, and without memory if they differ."""
    sample = forward.sample
    if sample.rig.effects == effects:
        return forward
    rig = sample.rig.model_copy(update={'effects': effects})
    return replace(forward, sample=replace(sample, rig=rig), memory=SimulationMemory())
