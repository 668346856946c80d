"""How far a free run lies from the maps of a recording, and how much of it the camera makes.

A camera blurs fronts over a part of a cell. A sharp front beside a blurred one makes an error that
no better model removes, so the error is told with the model blurred as well.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray, relative_error
from porotwin_core.model.held_out_share import HELD_OUT_SHARE, held_out_begin
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.error_parts import (
    COARSER,
    ErrorParts,
    error_parts,
    held_out_frames,
    in_words,
)
from porotwin_diagnosis.data.initial_tracer import initial_tracer
from porotwin_diagnosis.data.noise import TRACER_PRESENT, blurred, noise_floor
from porotwin_diagnosis.data.noise_estimation import measure_noise, measure_point_spread_width
from porotwin_diagnosis.data.observed_maps import evenly_spread
from porotwin_diagnosis.data.sample import Sample, coarsened, read_sample
from porotwin_diagnosis.model.forward import Forward
from porotwin_recording.experiment.recording import Recording
from porotwin_solver.model.presets import preset_named

LACKS_START = (
    '. The free run starts clean, but the first map holds tracer from before the recording: these '
    'errors say nothing about the model; `diagnose` starts with that map'
)
"""Words on a recording that begins in the middle of an experiment."""

MOST_FRAMES = 60
"""Most compared frames; more have the same noise of the sand."""


@dataclass(frozen=True)
class FreeRunErrors:
    """Relative L2 errors over the last 30 % of a recording.

    Attributes:
        error: of the model as it is.
        blurred_error: of the model, blurred as the maps are.
        blur_cells: width of that blur [cells], chosen for the least error.
        noise: error of a perfect model with that blur, by the noise of the maps.
        lacks_start: whether the first map holds tracer that the free run does not start with.
        parts: parts of `error`, of a dozen frames; None where there are too few.
    """

    error: float
    blurred_error: float
    blur_cells: float
    noise: float
    lacks_start: bool = False
    parts: ErrorParts | None = None

    def __str__(self) -> str:
        """Return the errors in words."""
        parts = '' if self.parts is None else f'. It is made by: {in_words(self.parts)}'
        return (
            f'free run beside the maps of the recording, last {percent(HELD_OUT_SHARE)}: error '
            f'{percent(self.error, 1)}, or {percent(self.blurred_error, 1)} with fronts blurred as '
            f'in the maps (--blur {self.blur_cells:.2f}); the noise of the maps alone, without '
            f'blur, makes {percent(self.noise, 1)}' + (LACKS_START if self.lacks_start else parts)
        )


@dataclass
class LateMaps:
    """The compared frames of a recording, and the simulated maps at their times.

    `preset` and `effects` are those of the simulation.
    """

    recording: Recording
    preset: str
    effects: Sequence[EffectDescription]
    _simulated: dict[int, FloatArray] = field(default_factory=dict)
    _frames: Sample | None = None

    def __post_init__(self) -> None:
        times = self.recording.times
        begin = held_out_begin(times[0], times[-1])
        chosen = evenly_spread(np.flatnonzero(times >= begin), MOST_FRAMES)
        self._late = tuple(map(int, chosen))
        with suppress(InputError):  # too few frames for the parts
            self._frames = held_out_frames(read_sample(self.recording))
        more = () if self._frames is None else np.searchsorted(times, self._frames.times)
        self._wanted = {*self._late, *map(int, more)}

    def see(self, number: int, simulated: FloatArray) -> None:
        """Keep the simulated map of frame `number` if it is compared."""
        if number in self._wanted:
            self._simulated[number] = simulated

    def errors(self) -> FreeRunErrors | None:
        """Return the errors of the maps that were seen; None if they show no tracer."""
        maps = self.recording.maps
        assert maps is not None
        observed = np.stack([maps[number] for number in self._late]).astype(float)
        if not np.nanmax(observed, initial=0.0) > TRACER_PRESENT:
            return None
        predicted = np.stack([self._simulated[number] for number in self._late])
        noise = measure_noise(observed)
        width = measure_point_spread_width(observed, predicted, noise)
        spread = blurred(predicted, width)
        return FreeRunErrors(
            relative_error(predicted, observed),
            relative_error(spread, observed),
            width,
            noise_floor(noise, spread, observed),
            initial_tracer(self.recording) is not None,
            self._parts(width),
        )

    def _parts(self, width: float) -> ErrorParts | None:
        """Return the parts of the error with the blur `width` [cells], None with too few frames."""
        late = self._frames
        if late is None:
            return None
        numbers = np.searchsorted(self.recording.times, late.times)
        coarse = Forward(
            coarsened(replace(late, initial=None), COARSER),
            preset=self.preset,
            refinement=preset_named(self.preset).refinement(late.grid),
        ).maps(self.effects)
        predicted = np.stack([self._simulated[int(number)] for number in numbers])
        return error_parts(late, predicted, coarse, width)
