"""The imaging chain: from the bytes of a photograph to a map of tracer concentration.

    imaging = Imaging(rig, grid, calibration=load_calibration('calibration.yaml'))
    imaging.set_baselines([jpeg_bytes, ...])
    found = imaging.concentration(jpeg_bytes)

A photograph is decoded as coarsely as the map allows, aligned to the baseline, read once at the
sampling points, averaged over the map's cells in linear light, matched to the baseline's colours
and light, compared with the baseline, scaled, and denoised.
"""

import copy
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Rig
from porotwin_imaging import colour_checker, light, photograph, recognition, validity
from porotwin_imaging.calibration import Calibration
from porotwin_imaging.cell_sums import CellSums, cell_sums, coarser
from porotwin_imaging.geometry import Geometry
from porotwin_imaging.registration import Aligner, Alignment
from porotwin_imaging.sampling import Sampling, choose_reduction
from porotwin_imaging.total_variation import denoise, fill

Array = NDArray[Any]

_LEVELS = np.arange(256) / 255
LINEAR_LIGHT = np.where(
    _LEVELS <= 0.04045, _LEVELS / 12.92, ((_LEVELS + 0.055) / 1.055) ** 2.4
).astype(np.float32)
"""Linear light of the 256 grey levels of sRGB."""


CREDIBLE = (-0.5, 1.5)
"""Concentration beyond which a cell's noise, not its tracer, is seen; it must not smear around."""
MOST_HIDDEN = 0.4
"""Share of the sand that may be covered or damaged in a photograph that is still read."""
FEWEST_SAMPLES_ACROSS = 5
"""Samples each way from which a cell's own scatter says how noisy it is."""


@dataclass(frozen=True)
class Settings:
    """How the chain works.

    `smoothing_m`: length of the total-variation denoising [m]; `tolerance`: its error [-];
    `least_valid_share`: share of a cell that must be seen for it to have a value;
    `reported_shift_px`: camera shift, in pixels of the file, from which the status tells of it;
    `correlated_samples`: samples that share one error, since JPEG and interpolation smear it;
    `averaging_reach`: cells, each way, over which denoising averages at most; `light_error`: what
    the light's drift is not known to [-];
    `suspicious_residual_px`: misfit of the alignment, in decoded pixels, that marks the map.
    """

    smoothing_m: float = 1e-4
    tolerance: float = 4e-3
    least_valid_share: float = 0.3
    reported_shift_px: float = 2.0
    correlated_samples: float = 3.3
    averaging_reach: float = 5.0
    light_error: float = 1.5e-3
    suspicious_residual_px: float = 0.35


@dataclass(frozen=True)
class ConcentrationMap:
    """A map of tracer concentration, read from one photograph.

    `values` (nz, nx) float32, row 0 the bottom, 1 = tracer stock, NaN where the photograph says
    nothing; `noise` (nz, nx): standard deviation of `values`; `calibrated`: whether the scale is
    measured; `suspicious`: whether the map should be looked at before it is believed; `status`:
    what a reader should know, one line each; `timings`: seconds by stage; `alignment`: how the
    camera had moved.
    """

    values: NDArray[np.float32]
    noise: NDArray[np.float32]
    calibrated: bool
    suspicious: bool
    status: list[str]
    timings: dict[str, float]
    alignment: Alignment

    @property
    def typical_noise(self) -> float:
        """Median standard deviation over the cells that are seen [-]; NaN when none is."""
        seen = self.noise[np.isfinite(self.noise)]
        return float(np.median(seen)) if seen.size else math.nan


@dataclass(frozen=True)
class Measurement:
    """A photograph compared with the baseline, on the map's cells, before any scaling.

    `log_ratio` (nz, nx, 3 = red, green, blue): log of the light relative to the baseline's, the
    light's drift removed; `variance` (nz, nx, 3) of it; `seen` (nz, nx); `drift`: what was removed;
    `suspicious`: whether a person should look at it.
    """

    log_ratio: Array
    variance: Array
    seen: NDArray[np.bool_]
    drift: light.Light
    alignment: Alignment
    remarks: list[str]
    suspicious: bool


@dataclass
class _Stopwatch:
    timings: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.timings[name] = self.timings.get(name, 0.0) + time.perf_counter() - start


@dataclass(frozen=True)
class _Baseline:
    """What all photographs are compared with.

    On the sampling grid `colours` (rows, columns, 3): linear red, green, blue; `usable` (rows,
    columns) 0 or 1. `patches` (24, 3): the chart's, None when it was not found; `matrix` (3, 3)
    takes the camera's colours to the chart's reference; `fluctuation` (nz, nx, 3): variance of the
    log ratio between several baselines.
    """

    colours: Array
    usable: NDArray[np.uint8]
    patches: Array | None
    matrix: Array
    fluctuation: Array


class Imaging:
    """The chain of one camera and rig; `set_baselines` first, then any number of photographs."""

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        *,
        calibration: Calibration | None = None,
        settings: Settings | None = None,
    ) -> None:
        """Prepare for photographs of `rig` and maps on `grid`.

        Raises:
            InputError: the rig has no camera, or one that cannot be.
        """
        self.rig = rig
        self.grid = grid
        self.settings = settings or Settings()
        self.calibrated = calibration is not None
        self.calibration = calibration or Calibration()
        self.validity: validity.Validity | None = None
        self._geometry = Geometry.of(rig)
        self._factors = self.calibration.factor_map(grid)
        self._baseline: _Baseline | None = None

    def set_baselines(self, photographs: Sequence[bytes]) -> list[str]:
        """Take photographs without tracer as the reference of all that follow.

        Returns remarks, one line each. After an error the earlier baselines stay in use.

        Raises:
            InputError: no photograph, or one that cannot be used.
        """
        if not photographs:
            raise InputError('no baseline photograph: give one taken before the injection')
        fresh = copy.copy(self)  # what fails half way leaves nothing behind in what is in use
        remarks = fresh._take_baselines(photographs)
        vars(self).update(vars(fresh))
        return remarks

    def _take_baselines(self, photographs: Sequence[bytes]) -> list[str]:
        self._photo_size = photograph.size(photographs[0])
        self._refuse_outside(self._photo_size)
        self.reduction = choose_reduction(self._geometry, self.grid, self._photo_size[0])
        first = self._decode(photographs[0])
        self._aligner = Aligner(first.pixels, self._region(first.pixels.shape))
        self.sampling = Sampling.of(self._geometry, self.grid, self.reduction)
        pictures = [first, *(self._decode(data) for data in photographs[1:])]
        remarks = self._combine([picture.pixels for picture in pictures])
        turned = photograph.orientation(photographs[0])
        if turned != 1:
            remarks.append(
                f'EXIF orientation {turned} is not applied: camera.corners_px must count pixels as '
                'the file holds them, not as a viewer that turns the photograph shows them'
            )
        if len(photographs) == 1:
            remarks.append('one baseline: the fluctuation between photographs is not known')
        return remarks

    def concentration(self, data: bytes) -> ConcentrationMap:
        """Return the concentration that the photograph `data` (the file's bytes) shows.

        Raises:
            InputError: the photograph cannot be used; one line says why.
        """
        watch = _Stopwatch()
        measured = self._measure(data, watch)
        response = self.calibration.response
        with watch.stage('signal'):
            signal = self.calibration.signal.of(measured.log_ratio) * self._factors
            spread = self.calibration.signal.noise(measured.log_ratio, measured.variance)
            raw = np.clip(response.concentration_of(signal), *CREDIBLE)
            raw = np.where(measured.seen, raw, np.nan)
            noise = spread * self._factors * response.slope_at(signal)
        with watch.stage('denoise'):
            # unseen cells are not shown: what is carried into them only continues the map
            smooth = denoise(
                fill(raw, measured.seen.astype(np.float32)),
                np.where(measured.seen, _confidence(noise, measured.seen), 1.0),
                spacing=(self.grid.dz, self.grid.dx),
                length=self.settings.smoothing_m,
                tolerance=self.settings.tolerance,
            )
            values = np.where(measured.seen, np.clip(smooth.values, 0.0, 1.0), np.nan)
            noise = self._noise_after(noise, values)
        status = [] if self.calibrated else ['uncalibrated: default scaling']
        return ConcentrationMap(
            values.astype(np.float32),
            noise.astype(np.float32),
            self.calibrated,
            measured.suspicious,
            status + measured.remarks,
            watch.timings,
            measured.alignment,
        )

    def _noise_after(self, noise: Array, values: Array) -> Array:
        """Return the standard deviation (nz, nx) of denoised `values`, from that of the data.

        Denoising averages over the cells around that hold the same concentration to within the
        noise; to the rest come what the light and the scale are not known to.
        """
        slope = np.hypot(*np.gradient(np.nan_to_num(values)))
        reach = np.clip(noise / np.maximum(slope, 1e-9), 0.0, self.settings.averaging_reach)
        averaged = noise / (1.0 + 2.0 * reach)
        scale = self.calibration.scale_error * values
        return np.sqrt(averaged**2 + scale**2 + self.settings.light_error**2)

    def measure(self, data: bytes) -> Measurement:
        """Return what the photograph shows before any scaling; calibration starts from this.

        Raises:
            InputError: the photograph cannot be used; one line says why.
        """
        return self._measure(data, _Stopwatch())

    def _measure(self, data: bytes, watch: _Stopwatch) -> Measurement:
        if self._baseline is None:
            raise InputError('no baseline yet: give a photograph taken before the injection')
        with watch.stage('decode'):
            picture = self._decode(data)
        with watch.stage('align'):
            alignment = self._aligner.align(picture.pixels)
        with watch.stage('remap'):
            sampled = self.sampling.sample(picture.pixels, alignment.homography)
        with watch.stage('average'):
            log_ratio, variance, sums = self._compare(sampled, self._baseline)
            seen, covered = self._seen(sums)
        with watch.stage('light'):
            gain, remarks = self._checker_gain(picture.pixels, alignment, self._baseline)
            drift = light.drift(log_ratio, np.where(seen, sums.share, 0.0), gain)
        return Measurement(
            log_ratio - drift.log_gain,
            variance,
            seen,
            drift,
            alignment,
            self._remarks(alignment) + remarks + covered,
            alignment.residual > self.settings.suspicious_residual_px or bool(covered),
        )

    @property
    def matched_patches(self) -> Array | None:
        """The chart's patches (24, 3) in the baseline, matched to the reference; None unseen."""
        if self._baseline is None or self._baseline.patches is None:
            return None
        return self._baseline.patches @ self._baseline.matrix.T

    @property
    def baseline_cells(self) -> tuple[Array, Array]:
        """The baseline's linear colours (nz, nx, 3) and texture (nz, nx), for telling sands apart.

        Raises:
            InputError: there is no baseline yet.
        """
        if self._baseline is None:
            raise InputError('no baseline yet: give a photograph taken before the injection')
        usable = self._baseline.usable.astype(np.float32)
        share = np.maximum(self.sampling.cell_means(usable), 1e-3)
        colours = self._baseline.colours * usable[..., None]
        rough = validity.texture(self._baseline.colours).astype(np.float32) * usable
        return (
            self.sampling.cell_means(colours) / share[..., None],
            self.sampling.cell_means(rough) / share,
        )

    def _combine(self, pictures: list[NDArray[np.uint8]]) -> list[str]:
        """Make the baseline from decoded pictures, the first of which all are aligned to."""
        sampled = [_linear(self.sampling.sample(pictures[0]))]
        for pixels in pictures[1:]:
            alignment = self._aligner.align(pixels)
            sampled.append(_linear(self.sampling.sample(pixels, alignment.homography)))
        self.validity = validity.judge(
            sampled[0], width=self.grid.width, checker=self._checker_on_sampling()
        )
        usable = self.validity.usable
        if self.calibration.hidden is not None:
            hidden = cv2.resize(
                self.calibration.hidden, usable.shape[::-1], interpolation=cv2.INTER_NEAREST
            )
            usable &= hidden < 128
        share = self.sampling.cell_means(usable.astype(np.float32))
        if not (share > self.settings.least_valid_share).any():
            raise InputError('baseline shows nothing of the sand: check light and corners_px')
        remarks, patches, matrix = self._match_colours(pictures[0])
        colours, fluctuation = self._average(sampled, usable, share)
        self._baseline = _Baseline(colours, usable.astype(np.uint8), patches, matrix, fluctuation)
        return remarks

    def _average(
        self, sampled: list[Array], usable: NDArray[np.bool_], share: Array
    ) -> tuple[Array, Array]:
        """Return the mean of sampled baselines, in the light of the first, and their fluctuation.

        The fluctuation (nz, nx, 3) is the variance of the log ratio of one photograph to them.
        """
        if len(sampled) == 1:
            return sampled[0], np.zeros((*self.grid.shape, 3), np.float32)
        means = [self.sampling.cell_means(one * usable[..., None]) for one in sampled]
        drifts = [light.drift(_log_ratio(mean, means[0]), share, None) for mean in means]
        ratios = np.array(
            [
                _log_ratio(mean, means[0]) - drift.log_gain
                for mean, drift in zip(means, drifts, strict=True)
            ]
        )
        gains = [drift.log_gain.mean(axis=(0, 1)) for drift in drifts]
        alike = [one * np.exp(-gain) for one, gain in zip(sampled, gains, strict=True)]
        return np.mean(alike, axis=0).astype(np.float32), ratios.var(axis=0, ddof=1)

    def _compare(
        self, sampled: NDArray[np.uint8], baseline: _Baseline
    ) -> tuple[Array, Array, CellSums]:
        """Return log ratio (nz, nx, 3) to the baseline, its variance, and the sums they are from.

        Colours are those of the chart's reference: what the checker's matrix makes of the camera's,
        which on means over cells is the same as on every pixel. The ratio of sums over a cell
        weights every grain by its own light; its variance is that of a ratio estimator (Cochran,
        Sampling Techniques, sec. 6.4), from what the samples leave.
        """
        sums = cell_sums(
            sampled,
            baseline.colours,
            baseline.usable,
            light=LINEAR_LIGHT,
            glare_level=photograph.BRIGHT_LEVEL,
            factor=self.sampling.factor,
        )
        matrix = baseline.matrix.astype(np.float32)
        state, before = (light @ matrix.T for light in (sums.state, sums.baseline))
        variance = self._scatter(sums, matrix)
        variance *= (self.settings.correlated_samples / self.sampling.factor**2) / np.maximum(
            sums.share, 0.05
        )[..., None]
        return _log_ratio(state, before), variance + baseline.fluctuation, sums

    def _seen(self, sums: CellSums) -> tuple[NDArray[np.bool_], list[str]]:
        """Return which cells (nz, nx) show their sand, and a remark where some should and do not.

        Raises:
            InputError: most of the sand is covered, or the file is damaged.
        """
        usual = sums.share > self.settings.least_valid_share
        blocks = recognition.hidden(coarser(sums, self._blocks)).astype(np.uint8)
        size = (self.grid.nx, self.grid.nz)
        lost = cv2.resize(blocks, size, interpolation=cv2.INTER_NEAREST).astype(bool) & usual
        share = float(lost.sum() / max(1, usual.sum()))
        if share > MOST_HIDDEN:
            raise InputError(
                f'photograph does not show the grains of the baseline on {100 * share:.0f} % of '
                'the sand: a damaged file, or something before the camera'
            )
        if not lost.any():
            return usual, []
        remark = (
            f'{100 * share:.1f} % of the sand is covered or damaged in the photograph: left out'
        )
        return usual & ~lost, [remark]

    def _scatter(self, sums: CellSums, matrix: Array) -> Array:
        """Return the relative variance (nz, nx, 3) of a sample about the cell's ratio.

        Of cells with few samples, that of the block of cells around.
        """
        blocks = coarser(sums, self._blocks)
        ratio = blocks.state / np.maximum(blocks.baseline, 1e-6)
        left = blocks.state_square - 2 * ratio * blocks.product + ratio**2 * blocks.baseline_square
        share = np.maximum(blocks.share, 0.05)[..., None]
        state = np.maximum(blocks.state @ matrix.T / share, 1e-4)
        relative = np.maximum(left / share, 0.0) @ (matrix**2).T / state**2
        size = (self.grid.nx, self.grid.nz)
        return np.asarray(cv2.resize(relative, size, interpolation=cv2.INTER_LINEAR))

    @property
    def _blocks(self) -> int:
        """Cells each way that together hold enough samples to judge their scatter."""
        return math.ceil(FEWEST_SAMPLES_ACROSS / self.sampling.factor)

    def _match_colours(self, pixels: NDArray[np.uint8]) -> tuple[list[str], Array | None, Array]:
        """Return remarks, the baseline's patches (24, 3), and its matrix to the chart's colours."""
        corners = self._checker_corners()
        if corners is None:
            return [], None, np.eye(3)
        found = colour_checker.find(_linear(pixels), corners)
        if found is None:
            return ['colour checker not found: light is judged by the sand alone'], None, np.eye(3)
        matrix, kept = colour_checker.fit_matrix(found.patches, colour_checker.REFERENCE)
        if not colour_checker.plausible(matrix):
            remark = 'colour checker not believed: light is judged by the sand alone'
            return [remark], None, np.eye(3)
        remarks = [
            f'colour checker found {found.moved_px * self.reduction:.0f} px from its given place, '
            f'{kept.sum()} of 24 patches used'
        ]
        return remarks, found.patches, matrix

    def _checker_gain(
        self, pixels: NDArray[np.uint8], alignment: Alignment, baseline: _Baseline
    ) -> tuple[Array | None, list[str]]:
        """Return the log gain (3,) of light since the baseline at the colour checker, if seen."""
        corners = self._checker_corners()
        if corners is None or baseline.patches is None:
            return None, []
        moved = cv2.perspectiveTransform(corners[:, None].astype(np.float64), alignment.homography)
        found = colour_checker.find(_linear_near(pixels, moved[:, 0]), moved[:, 0])
        gain = None if found is None else colour_checker.log_gain(found.patches, baseline.patches)
        if gain is None:
            return None, ['colour checker not seen: light is judged by the sand alone']
        return gain, []

    def _checker_corners(self) -> Array | None:
        camera = self.rig.camera
        if camera is None or camera.colour_checker_px is None:
            return None
        return (np.array(camera.colour_checker_px) + 0.5) / self.reduction - 0.5

    def _checker_on_sampling(self) -> Array | None:
        """Return the checker's corners as (column, row) on the sampling grid."""
        camera = self.rig.camera
        if camera is None or camera.colour_checker_px is None:
            return None
        x, z = self._geometry.to_metres(*np.array(camera.colour_checker_px).T)
        rows, columns = self.sampling.shape
        return np.stack([x / self.grid.width * columns, (1 - z / self.grid.height) * rows], axis=1)

    def _remarks(self, alignment: Alignment) -> list[str]:
        remarks = []
        if alignment.shift * self.reduction > self.settings.reported_shift_px:
            remarks.append(
                f'camera has moved by {alignment.shift * self.reduction:.1f} px: corrected'
            )
        if alignment.residual > self.settings.suspicious_residual_px:
            remarks.append(
                f'alignment leaves {alignment.residual * self.reduction:.1f} px: the picture is '
                'deformed against the baseline'
            )
        return remarks

    def _decode(self, data: bytes) -> photograph.Photograph:
        size = photograph.size(data)
        if size != self._photo_size:
            raise InputError(
                f'photograph is {size[0]} x {size[1]} px, the baseline {self._photo_size[0]} x '
                f'{self._photo_size[1]} px; keep the camera as it is or take a new baseline'
            )
        return photograph.decode(data, self.reduction)

    def _refuse_outside(self, size: tuple[int, int]) -> None:
        assert self.rig.camera is not None
        corners = np.array(self.rig.camera.corners_px)
        slack = 0.02 * size[0]
        if (corners < -slack).any() or (corners > np.array(size) + slack).any():
            raise InputError(
                f'photograph is {size[0]} x {size[1]} px, but camera.corners_px reach to '
                f'{corners.max(axis=0).tolist()}; correct rig.yaml or use photographs of this rig'
            )

    def _region(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        assert self.rig.camera is not None
        corners = np.array(self.rig.camera.corners_px) / self.reduction
        region = np.zeros(shape[:2], np.uint8)
        cv2.fillPoly(region, [np.rint(corners).astype(np.int32)], 1)
        return region.astype(bool)


def _linear(pixels: NDArray[np.uint8]) -> Array:
    """Return linear red, green, blue of 8-bit blue, green, red."""
    return cv2.LUT(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), LINEAR_LIGHT)


def _linear_near(pixels: NDArray[np.uint8], corners: Array) -> Array:
    """Return the linear colours of a picture of the same shape, filled only near `corners`."""
    reach = 2 * int(np.ptp(corners, axis=0).max())
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - reach, 0)
    high = np.ceil(corners.max(axis=0)).astype(int) + reach
    picture = np.zeros(pixels.shape, np.float32)
    area = (slice(low[1], high[1]), slice(low[0], high[0]))
    picture[area] = _linear(np.ascontiguousarray(pixels[area]))
    return picture


def _log_ratio(state: Array, baseline: Array) -> Array:
    """Return ln(state / baseline); both are linear light, and 0 where nothing is seen."""
    return np.log(np.maximum(state, 1e-5) / np.maximum(baseline, 1e-5))


def _confidence(noise: Array, seen: NDArray[np.bool_]) -> Array:
    """Return weights (nz, nx) from 0 to 1 for the denoising: the noise's inverse variance.

    A cell of the median noise counts fully, so that `smoothing_m` means the same in every picture.
    """
    if not seen.any():
        return np.zeros_like(noise)
    usual = float(np.median(noise[seen]))
    return np.where(seen, np.minimum((usual / np.maximum(noise, 1e-9)) ** 2, 1.0), 0.0)
