"""The held-out part of a recording: errors before and after, and how much of the gap closes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from porotwin_core.grid import FloatArray, relative_error
from porotwin_diagnosis.data.noise import blurred

LEAST_ROOM = 1e-4
"""Error above the noise floor below which there is no gap that could close."""

WORSE = 1.02
"""Error, in those of the model as it is, above which a mended model is worse: where the pumps rest
at last, and the gap arose before, the two hardly differ."""

TIME_BLOCKS, TILES = 6, (4, 6)
"""Blocks of frames and tiles of the picture (rows, columns) that are drawn again."""

DRAWS = 400
INTERVAL = (5.0, 95.0)
"""Percentiles of the draws: an interval of 90 %."""


@dataclass(frozen=True)
class HeldOut:
    """The held-out part of one recording in full: all frames, observed and predicted.

    Arrays are (nt, nz, nx); errors are relative L2 norms over the frames. `blur` [cells] is by how
    much the observed maps are softer than the predicted ones.
    """

    times: FloatArray
    observed: FloatArray
    before: FloatArray
    after: FloatArray
    error_before: float
    error_after: float
    noise_floor: float
    blur: float = 0.0

    @property
    def remainder(self) -> FloatArray:
        """The root mean square over the frames of what the model leaves, (nz, nx); 0 if unseen."""
        known = np.isfinite(self.observed)
        square = np.where(known, self.after - self.observed, 0.0) ** 2
        return np.asarray(np.sqrt(square.sum(axis=0) / np.maximum(known.sum(axis=0), 1)))

    def softened_errors(self) -> tuple[float, float]:
        """Return the errors before and after of predictions made as soft as the observed maps."""
        before, after = (blurred(maps, self.blur) for maps in (self.before, self.after))
        return relative_error(before, self.observed), relative_error(after, self.observed)

    def drawn(self, seed: int) -> FloatArray:
        """Return squares of the relative errors before and after, (DRAWS, 2), drawn again.

        Blocks of frames and tiles are drawn with replacement, each by itself, for errors go on in
        time where they are and spread in space at one time (the pigeonhole bootstrap: Owen, Ann.
        Appl. Stat. 1 (2007) 386).
        """
        known = np.isfinite(self.observed)
        observed = np.where(known, self.observed, 0.0)
        norm = _blocks(observed**2)
        before, after = (
            _blocks(np.where(known, predicted - observed, 0.0) ** 2)
            for predicted in (self.before, self.after)
        )
        random = np.random.default_rng(seed)
        times, tiles = norm.shape
        drawn_times = random.multinomial(times, np.full(times, 1.0 / times), DRAWS)
        drawn_tiles = random.multinomial(tiles, np.full(tiles, 1.0 / tiles), DRAWS)

        def total(values: FloatArray) -> FloatArray:
            return np.einsum('dt,ts,ds->d', drawn_times, values, drawn_tiles)

        norms = np.maximum(total(norm), 1e-12)
        return np.stack([total(before) / norms, total(after) / norms], axis=1)


def gap_closed(before: float, after: float, floor: float) -> float:
    """Return the share of a gap above the noise floor that closes, by the diagnosis contract; 0
    without a gap.

    Above 1 where less is left than noise was expected to leave, negative where the error grows.
    """
    room = before - floor
    return (before - after) / room if room > LEAST_ROOM else 0.0


def softened(parts: Sequence[HeldOut]) -> tuple[float, float]:
    """Return the errors of all recordings together, before and after, of predictions as soft as the
    camera shows them.

    The plain errors say less: an effect that thins the fringe of a plume, as a bent response does,
    costs more where the camera smears it than it gains elsewhere.
    """
    before, after = zip(*(part.softened_errors() for part in parts), strict=True)
    return root_mean(before), root_mean(after)


def worsened(parts: Sequence[HeldOut]) -> bool:
    """Return whether the `softened` errors speak against the mended model."""
    before, after = softened(parts)
    return after > WORSE * before


def together(parts: Sequence[HeldOut]) -> tuple[float, tuple[float, float]]:
    """Return the share of the gap of all recordings that closes, and its 90 % interval.

    The noise floor is expected, not observed, and kept as it is in every draw.
    """
    floor = root_mean([part.noise_floor for part in parts])
    closed = gap_closed(
        root_mean([part.error_before for part in parts]),
        root_mean([part.error_after for part in parts]),
        floor,
    )
    before, after = np.sqrt(
        np.mean([part.drawn(seed) for seed, part in enumerate(parts)], axis=0)
    ).T
    drawn = [gap_closed(*errors, floor) for errors in zip(before, after, strict=True)]
    low, high = np.percentile(drawn, INTERVAL)
    return closed, (min(float(low), closed), max(float(high), closed))


def root_mean(values: Sequence[float]) -> float:
    """Return the root mean square of errors of several recordings."""
    return float(np.sqrt(np.mean(np.square(values))))


def _blocks(values: FloatArray) -> FloatArray:
    """Return the sums of `values` (nt, nz, nx) over blocks of frames and tiles, (t, s)."""
    edges = [
        np.unique(np.linspace(0, size, count + 1).astype(int))[:-1]
        for size, count in zip(values.shape, (TIME_BLOCKS, *TILES), strict=True)
    ]
    for axis, starts in enumerate(edges):
        values = np.add.reduceat(values, starts, axis=axis)
    return values.reshape(len(values), -1)
