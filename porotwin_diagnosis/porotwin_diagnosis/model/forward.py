"""The forward model: simulated maps of a recording with any effects, as seen by the camera."""

from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Lock
from typing import Any

import numpy as np

from porotwin_core.geometry.grid import FloatArray, conservative_resample
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, Sample
from porotwin_diagnosis.model.effect_traits import needs_simulation
from porotwin_solver.effects import observation_operator
from porotwin_solver.model.simulated_readings import simulated_readings
from porotwin_solver.model.simulation import simulated_maps

REMEMBERED_SIMULATIONS = 40
"""Simulations in memory per forward model. One takes about 3 MB on the small rig."""

Effects = Sequence[EffectDescription]
"""Effects in the order of their application."""


class SimulationMemory:
    """The latest simulations of one forward model, and the number of different ones.

    All corrected versions of the forward model share it. Threads that ask for the same simulation
    make it once.
    """

    def __init__(self) -> None:
        self._maps: OrderedDict[str, FloatArray] = OrderedDict()
        self._turns: defaultdict[str, Lock] = defaultdict(Lock)
        self._lock = Lock()

    @property
    def count(self) -> int:
        """Number of different simulations so far."""
        return len(self._turns)

    def maps(self, key: str, frames: int, make: Callable[[], FloatArray]) -> FloatArray:
        """Return the first `frames` maps (frames, nz, nx) [-] of the simulation `key`.

        `make` computes maps that are not in memory. A later call may repeat the work, for more
        frames or after other simulations took the place.
        """
        with self._lock:
            turn = self._turns[key]
        with turn:
            with self._lock:
                known = self._maps.get(key)
                if known is not None and len(known) >= frames:
                    self._maps.move_to_end(key)
                    return known[:frames]
            made = make()
            with self._lock:
                self._maps[key] = made
                while len(self._maps) > REMEMBERED_SIMULATIONS:
                    self._maps.popitem(last=False)
            return made


@dataclass(frozen=True, eq=False)
class Forward:
    """Free-running predictions of one recording at its selected frames.

    Attributes:
        sample: the recording.
        preset: preset of the solver.
        refinement: solver cells per cell of the sample, each way; None for the preset's own.
        correction: multifidelity correction (nt, nz, nx) [-] that is added to simulated maps.
        point_spread_width: width [cells] of the point spread of the camera, which simulated maps
            lack.
        memory: simulations made before. It belongs to the sample, the preset and the refinement.
        crew: runs the simulations; None: the thread that wants one does.
    """

    sample: Sample
    preset: str = field(default='fast', kw_only=True)
    refinement: int | None = field(default=None, kw_only=True)
    correction: FloatArray | None = field(default=None, kw_only=True)
    point_spread_width: float = field(default=0.0, kw_only=True)
    memory: SimulationMemory = field(default_factory=SimulationMemory, kw_only=True, repr=False)
    crew: Executor | None = field(default=None, kw_only=True, repr=False)

    @property
    def simulations(self) -> int:
        """Number of different simulations so far, also of corrected versions of this model."""
        return self.memory.count

    def maps(self, effects: Effects, *, fitted_only: bool = False) -> FloatArray:
        """Return the noise-free maps that the camera would show with `effects`.

        Returns:
            Maps (nt, nz, nx) [-] of all frames, or of the fitted frames with `fitted_only`.

        Raises:
            InputError: the model cannot run with these effects.
        """
        physics = _simulated_part(effects)
        image = [effect for effect in effects if not needs_simulation(effect.name)]
        maps = self._simulated(physics, fitted_only=fitted_only)
        if self.correction is not None:
            maps = np.clip(maps + self.correction[: len(maps)], 0.0, 1.0)
        return np.stack(list(self._as_shown(maps, image))) if image else maps

    def readings_off(self, effects: Effects) -> FloatArray:
        """Return how far the readings lie above the model with `effects`, in deviations, (n,) [-].

        It is 0 for readings from before the model starts.

        Raises:
            InputError: the model cannot run with these effects.
        """
        sample, physics = self.sample, _simulated_part(effects)
        run = self._run(simulated_readings, sample.readings, physics)
        shown = self.memory.maps(f'readings {physics!r}', len(sample.readings), self._made(run))
        read, deviation = np.array([(one.value, one.deviation) for one in sample.readings]).T
        return np.nan_to_num((read - shown) / deviation)

    def _run(
        self, simulated: Callable[..., FloatArray], seen: Any, physics: Effects
    ) -> Callable[[], FloatArray]:
        """Return the call of `simulated` that runs the model to what is `seen`: times, readings."""
        sample = self.sample
        return partial(
            simulated,
            sample.rig,
            sample.schedule,
            seen,
            grid=sample.grid,
            preset=self.preset,
            effects=physics,
            initial=sample.initial_on(sample.grid),
            start=sample.model_start,
            refinement=self.refinement,
        )

    def _made(self, run: Callable[[], FloatArray]) -> Callable[[], FloatArray]:
        """Return a call of `run` by the crew, if there is one."""
        crew = self.crew
        return run if crew is None else lambda: crew.submit(run).result()

    def _as_shown(self, maps: FloatArray, image: Effects) -> Iterator[FloatArray]:
        """Yield `maps` as a camera with the effects `image` would show them."""
        sample = self.sample
        for frame, time in zip(maps, sample.times, strict=False):
            yield observation_operator(image, time).apply(frame, sample.grid, float(time))

    def uncorrected(self) -> 'Forward':
        """Return this model without a multifidelity correction."""
        return replace(self, correction=None)

    def corrected_by(
        self, finer: 'Forward', effects: Effects = (), *, extrapolation: float = 1.0
    ) -> 'Forward':
        """Return this model with the additive multifidelity correction of `finer` cells.

        Let f be the uncorrected maps of this model and F the maps of the finer model. Both are
        compared at the given `effects` e. The corrected maps at any other effects x are

            f(x) + extrapolation (F(e) - f(e)).

        The errors of coarse cells are nearly the same where fronts lie at nearly the same places
        (Peherstorfer, Willcox & Gunzburger, SIAM Review 60 (2018) 550, section 3.2). An
        `extrapolation` above 1 is a Richardson extrapolation to cells of size zero.

        Raises:
            InputError: the model cannot run with these effects.
        """
        physics = _simulated_part(effects)
        shape = self.sample.grid.shape
        fine = np.stack([conservative_resample(frame, shape) for frame in finer.maps(physics)])
        difference = fine - self.uncorrected().maps(physics)
        return replace(self, correction=extrapolation * difference)

    def _simulated(
        self, physics: tuple[EffectDescription, ...], *, fitted_only: bool
    ) -> FloatArray:
        sample = self.sample
        wanted = sample.fitted_frames if fitted_only else len(sample.times)
        simulation = self._run(_simulation, sample.times[:wanted], physics)
        return self.memory.maps(repr(physics), wanted, self._made(simulation))


def _simulation(*args: Any, **options: Any) -> FloatArray:
    """Return the maps (nt, nz, nx) [-] of `simulated_maps` with these arguments."""
    return np.stack([frame.astype(np.float32) for frame in simulated_maps(*args, **options)])


def _simulated_part(effects: Effects) -> tuple[EffectDescription, ...]:
    return tuple(effect for effect in effects if needs_simulation(effect.name))


def whitened_residuals(
    forwards: Sequence[Forward],
    effects: Effects,
    *,
    width: float = SMOOTHING_WIDTH,
    fitted_only: bool = False,
) -> list[FloatArray]:
    """Return the whitened residuals of all `forwards` with `effects`.

    Args:
        forwards: one forward model per recording.
        effects: effects of the rig and of the camera.
        width: width [cells] of the smoothing.
        fitted_only: whether to return the fitted frames only.

    Returns:
        One array (nt, nz', nx') [-] per recording; see `Sample.whitened`.

    Raises:
        InputError: the model cannot run with these effects.
    """
    return [
        forward.sample.whitened(
            forward.maps(effects, fitted_only=fitted_only),
            width=width,
            point_spread_width=forward.point_spread_width,
        )
        for forward in forwards
    ]
