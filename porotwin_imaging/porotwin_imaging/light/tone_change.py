"""Another tone curve, or haze: changes of light that depend on the brightness of the sand.

A drift of light multiplies bright and dark sand alike. Two changes do not:

    tone curve   state = gain light^(1 + p)      another picture style or gamma of the camera
    haze         state = gain light + offset     fog on the glass, stray light, a dirty lens

With r the log ratio of the state to the baseline light b, the change is undone by

    tone curve   r' = (r - p ln(b / b0)) / (1 + p)
    haze         r' = ln(exp(r) - offset / b)

which leave a constant gain for the drift of light. Sands of different brightness without tracer
determine p or the offset: the best value lets most of the sand follow one smooth light. The search
starts only if dark and bright sand drift apart. A colour chart shows both also where all sand is
alike (`colour_checker.chart_light`). Haze on the chart counts only if the sand cannot tell, and if
it explains the light of clean sand: a reflection on the chart alone is none.

Haze has a colour of its own. The clean sand of the best offset therefore tells the offset of every
channel by a straight line, state = gain light + offset. Haze brightens dark grains most, so that it
is taken from the samples of the photograph (`cell_sums`); the formula above is for cells.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_imaging.geometry.frame import VALIDITY
from porotwin_imaging.light.colour_checker import ChartLight
from porotwin_imaging.light.light_drift import LIGHT, light_drift
from porotwin_imaging.numerics.channels import channel_mean
from porotwin_imaging.numerics.robust_statistics import FEW_ROUNDS
from porotwin_imaging.tracer.tracer_colour import FEWEST_CELLS
from porotwin_imaging.tracer.tracer_signal import LEAST_RATIO


@dataclass(frozen=True)
class ToneSettings:
    """Another tone curve, or haze (`tone_change.py`)."""

    least_spread: float = 0.15
    """Spread of the brightness of the sands that shows a change of tone [log]."""
    least_slope: float = 0.006
    """Drift of the log ratio with the log of brightness from which a change is searched [-]. It is
    below 0.003 on real and rendered photographs."""
    brighter: float = 0.05
    """Cells that are brighter by more count as a sign of it [log ratio]; single cells are noisy."""
    brighter_share: float = 0.03
    """Share of such cells from which a change is searched [-]. In ordinary photographs it is 0."""
    most_level: float = 0.03
    """By so much may haze on the chart fit the level of clean sand worse than light alone [log]:
    light differs between chart and sand."""
    least_gain: float = 1.03
    """Sand that follows one smooth light after the correction, relative to before [-]."""


TONE = ToneSettings()


Array = NDArray[Any]
Mask = NDArray[np.bool_]

_POWERS = (-0.24, -0.16, -0.08, 0.08, 0.16, 0.24)
"""Changes of the power that are tried first."""
_OFFSETS = (-0.16, -0.08, -0.04, 0.04, 0.08, 0.16, 0.3, 0.5, 0.8)
"""Offsets that are tried first, relative to the light of the darker sand."""
_HALVINGS = 4
"""The step of the search, a quarter of the best amount at first, is halved so often."""
_DARK_PERCENTILE = 25.0
"""Percentile of the light that stands for darker sand."""
_SEARCH_CELLS = 3000
"""Blocks of cells used in the search."""


@dataclass(frozen=True)
class ToneChange:
    """A change of tone.

    Attributes:
        kind: 'curve' or 'haze', see the module.
        amount: p, or the offset [linear light].
        reference: light that keeps its log ratio, b0 [linear light].
        veil: red, green and blue of haze [linear light]; None for a curve.
    """

    kind: Literal['curve', 'haze']
    amount: float
    reference: float
    veil: tuple[float, float, float] | None = None

    def undone(self, log_ratio: Array, before: Array) -> Array:
        """Return the log ratios (nz, nx, 3) without the change.

        `before` is the linear light of the baseline, same shape.
        """
        if self.kind == 'curve':
            bent = log_ratio - self.amount * np.log(before / self.reference)
            return np.asarray(bent / (1.0 + self.amount), np.float32)
        ratio = np.exp(log_ratio) - self.amount / before
        return np.asarray(np.log(np.maximum(ratio, LEAST_RATIO)), np.float32)

    def contrast(self, log_ratio: Array, undone: Array) -> Array | float:
        """Return dr / dr', the scatter of log ratios relative to that of the undone ones.

        It is 1 + p for a curve, and exp(r' - r) for haze, in the shape of the ratios.
        """
        return 1.0 + self.amount if self.kind == 'curve' else np.exp(undone - log_ratio)

    @property
    def remark(self) -> str:
        """A line for the reader."""
        if self.kind == 'curve':
            return f'tone curve of the camera has changed (gamma {1 + self.amount:.2f}): corrected'
        share = 100 * self.amount / self.reference
        word = 'more' if share > 0 else 'less'
        return f'haze or stray light: {abs(share):.0f} % {word} light on dark sand: corrected'


def tone_of_chart(light: ChartLight) -> ToneChange | None:
    """Return the tone curve that the patches of the chart show; None if it is the same."""
    return ToneChange('curve', light.power, reference=1.0) if light.power else None


def haze_of_chart(
    light: ChartLight, log_ratio: Array, before: Array, visible: Mask
) -> ToneChange | None:
    """Return the haze that the chart shows if the sand may have it too; None otherwise.

    Sands of different brightness would show haze themselves (`tone_change`). Sand of one brightness
    shows only a level: that of clean sand must fit the light of the chart better with haze.

    Args:
        light: light at the chart.
        log_ratio: log ratio of photograph to baseline, shape (nz, nx, 3).
        before: linear light of the baseline in colours of the camera, same shape.
        visible: cells that show their sand, shape (nz, nx).
    """
    if light.veil is None or not visible.any():
        return None
    dark = float(np.percentile(channel_mean(before)[visible], _DARK_PERCENTILE))
    veil = (float(light.veil[0]), float(light.veil[1]), float(light.veil[2]))
    haze = ToneChange('haze', float(light.veil.mean()), max(dark, SMALLEST_DIVISOR), veil)
    if not _tells_tone(before, visible):
        weight = visible.astype(np.float32)
        drift = light_drift(log_ratio, weight, light.straight_gain).channels
        middle = np.median(before[visible], axis=0)
        hazy = np.log(np.maximum(np.exp(light.straight_gain) + light.veil / middle, LEAST_RATIO))
        apart = [float(np.abs(drift - gain).mean()) for gain in (hazy, light.straight_gain)]
        if apart[0] <= apart[1] + TONE.most_level:
            return haze
    return None


def _tells_tone(before: Array, visible: Mask) -> bool:
    """Return whether the sand of the baseline has parts of different brightness."""
    light = np.log(np.maximum(channel_mean(before)[visible], SMALLEST_DIVISOR))
    return bool(light.std() >= TONE.least_spread)


def tone_change(
    log_ratio: Array,
    before: Array,
    after: Array,
    visible: Mask,
    checker_gain: Array | None,
) -> ToneChange | None:
    """Return the change of tone of a photograph; None if it is ordinary.

    Args:
        log_ratio: log ratio of photograph to baseline, shape (nz, nx, 3).
        before: linear light of the baseline in colours of the camera, same shape.
        after: the same of the photograph.
        visible: cells that show their sand, shape (nz, nx).
        checker_gain: log gain at the colour chart, shape (3,), or None.
    """
    size = max(1, round(np.sqrt(visible.size / _SEARCH_CELLS)))
    search = _Search(
        _block_means(log_ratio, visible, size),
        np.maximum(_block_means(before, visible, size), SMALLEST_DIVISOR),
        np.maximum(_block_means(after, visible, size), SMALLEST_DIVISOR),
        _block_means(visible[..., None], np.ones_like(visible), size)[..., 0]
        > VALIDITY.least_judged_share,
        checker_gain,
    )
    if not search.is_unusual():
        return None
    best = max((search.best('curve', _POWERS), search.best('haze', _OFFSETS)), key=search.score)
    gain = search.score(best) / max(search.score(None), 1.0)
    if gain <= TONE.least_gain:
        return None
    if best.kind == 'curve':
        return best
    thin = (slice(size // 2, None, size), slice(size // 2, None, size))
    cells = _Search(log_ratio[thin], before[thin], after[thin], visible[thin], checker_gain)
    return cells.with_veil(best)


def _block_means(values: Array, visible: Mask, size: int) -> Array:
    """Return the means of visible `values` (nz, nx, n) over blocks of `size` cells; 0 without any.

    In single cells, shake alone makes bright grains darker and dark ones brighter, which looks like
    a tone curve. Sands differ over many cells.
    """
    rows, columns = (length // size for length in visible.shape)
    whole = (slice(0, rows * size), slice(0, columns * size))
    weight = visible[whole][..., None].astype(np.float32)
    shape = (rows, size, columns, size, -1)
    sums = (values[whole] * weight).reshape(shape).sum(axis=(1, 3))
    return np.asarray(sums / np.maximum(weight.reshape(shape).sum(axis=(1, 3)), 1.0))


@dataclass(frozen=True)
class _Search:
    """The search on means over blocks, and the veil of single cells: arguments of `tone_change`."""

    log_ratio: Array
    before: Array
    after: Array
    visible: Mask
    checker_gain: Array | None

    def is_unusual(self) -> bool:
        """Return whether dark and bright sand drift apart, or sand has become brighter."""
        light = np.log(channel_mean(self.before))
        if not self.visible.any() or not _tells_tone(self.before, self.visible):
            return False
        weight, residual = self._background(None)
        grey = channel_mean(residual)
        if (grey[self.visible] > TONE.brighter).mean() > TONE.brighter_share:
            return True
        chosen = weight > 0
        if chosen.sum() < FEWEST_CELLS:
            return False
        apart = light[chosen] - light[chosen].mean()
        weighted = weight[chosen] * apart
        slope = weighted @ grey[chosen] / max(float(weighted @ apart), SMALLEST_DIVISOR)
        seen = apart.std() > TONE.least_spread
        return bool(seen and abs(slope) > TONE.least_slope)

    def best(self, kind: Literal['curve', 'haze'], amounts: tuple[float, ...]) -> ToneChange:
        """Return the best change of a kind: the best of `amounts`, then refined."""
        grey = channel_mean(self.before)[self.visible]
        reference = float(np.percentile(grey, 50.0 if kind == 'curve' else _DARK_PERCENTILE))
        unit = 1.0 if kind == 'curve' else reference
        tried = [ToneChange(kind, amount * unit, reference) for amount in amounts]
        found = max(tried, key=self.score)
        step = abs(found.amount) / 4
        for _ in range(_HALVINGS):
            near = [ToneChange(kind, found.amount + sign * step, reference) for sign in (-1, 1)]
            found = max([found, *near], key=self.score)
            step /= 2
        return found

    def with_veil(self, haze: ToneChange) -> ToneChange:
        """Return `haze` with the offset of every channel, from the clean sand that it leaves.

        The scatter of a ratio does not depend on the light, so that every cell counts by its ratio.
        """
        ratio = haze.undone(self.log_ratio, self.before)
        for _ in range(FEW_ROUNDS):
            veil = self._lines(ratio)
            left = 1.0 - veil / np.maximum(self.after, SMALLEST_DIVISOR)
            ratio = self.log_ratio + np.log(np.maximum(left, LEAST_RATIO))
        red, green, blue = (float(value) for value in veil)
        return replace(haze, amount=float(np.mean(veil)), veil=(red, green, blue))

    def _lines(self, ratio: Array) -> Array:
        """Return the offset of every channel (3,), with clean sand by the log ratios `ratio`."""
        weight, residual = self._weighted(ratio)
        weight = np.maximum(weight, SMALLEST_DIVISOR * self.visible)
        smooth = channel_mean(np.exp(ratio - residual))
        smooth = smooth / np.average(smooth, weights=weight)
        root = np.sqrt(weight)
        offsets = []
        for channel in range(3):
            light = self.before[..., channel]
            terms = np.stack([smooth * root, root / light], axis=-1)
            right = root * self.after[..., channel] / light
            offsets.append(np.linalg.lstsq(terms.reshape(-1, 2), right.ravel(), rcond=None)[0][1])
        return np.array(offsets)

    def score(self, change: ToneChange | None) -> float:
        """Return the amount of sand that follows one smooth light."""
        return float(self._background(change)[0].sum())

    def _background(self, change: ToneChange | None) -> tuple[Array, Array]:
        """Return robust weights (nz, nx) of sand without tracer, and residuals (nz, nx, 3)."""
        if change is None:
            return self._weighted(self.log_ratio)
        undone = change.undone(self.log_ratio, self.before)
        return self._weighted(undone, change.contrast(self.log_ratio, undone))

    def _weighted(self, ratio: Array, contrast: Array | float = 1.0) -> tuple[Array, Array]:
        """Return the same for log ratios that are undone.

        Residuals are those of the photograph, `contrast` times those of the undone ratios.
        Otherwise a change would win by making noise smaller.
        """
        drift = light_drift(ratio, self.visible.astype(np.float32), self.checker_gain)
        residual = contrast * (ratio - drift.log_gain)
        distance = channel_mean(residual**2) / LIGHT.tolerance**2
        return self.visible * np.clip(1.0 - distance, 0.0, None) ** 2, residual
