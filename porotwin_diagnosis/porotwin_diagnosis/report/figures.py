"""The pictures of the report: plumes, where the gap arises, error over time, what is left."""

import io
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke

from porotwin_core.grid import FloatArray
from porotwin_core.units import to_ml_h
from porotwin_diagnosis.data.noise import noise_floor
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, Sample
from porotwin_diagnosis.decision.numerics import before_and_after
from porotwin_diagnosis.decision.verdict import NONE

if TYPE_CHECKING:
    from porotwin_diagnosis.decision.held_out import HeldOut
    from porotwin_diagnosis.examine import Diagnosis

PER_CENT_A_MINUTE = 6e3
"""What one per second of the tracer stock is in per cent per minute."""

DIM_GAP = 1.0
"""Least top [%/min] of the colours where there is no gap, so that noise does not look like one."""

FAINT = 0.15
"""Frames with less tracer than this share of the fullest have no relative error to speak of."""

DIFFERENCE = 'RdBu_r'
BEFORE, AFTER, SEEN = '#c8402f', '#1f6fb4', '0.15'


@dataclass(frozen=True)
class Course:
    """Relative error of each frame over time, (nt,) each, and where the held-out part begins."""

    times: FloatArray
    before: FloatArray
    after: FloatArray
    floor: FloatArray
    held_out_start: float


def photograph(content: bytes) -> Figure:
    """Return the photograph in the file `content`, as the camera took it.

    Raises:
        OSError, ValueError, SyntaxError: it is no picture, or a broken one.
    """
    picture = imread(io.BytesIO(content), format='jpg')  # the reader looks for itself what it is
    height, width = picture.shape[:2]
    figure = Figure(figsize=(10, 10 * height / width))
    axis = figure.add_axes((0, 0, 1, 1))
    axis.imshow(picture, cmap='gray')
    axis.set_axis_off()
    return figure


def plumes(result: 'Diagnosis', number: int = 0) -> Figure:
    """Return the last map of recording `number`: observed, before, after, and the differences."""
    part = result.held_out[number]
    observed, before, after = part.observed[-1], part.before[-1], part.after[-1]
    if result.verdict.name == NONE:
        return _plumes_without_gap(result, part)
    figure, axes = _panels(result, 2, 3)
    titles = ('observed', 'model as it is', _after_title(result))
    for axis, title, shown in zip(axes[0], titles, (observed, before, after), strict=True):
        image = _map(axis, result, shown, cmap='viridis', vmin=0, vmax=1)
        axis.set_title(f'{title}, {part.times[-1] / 60:.0f} min', fontsize=10)
    figure.colorbar(image, ax=axes[0], label='tracer [share of stock]', shrink=0.9)
    _fronts(axes[1, 0], result, part)
    for axis, title, shown in zip(axes[1, 1:], titles[1:], (before, after), strict=True):
        difference = _map(axis, result, observed - shown, cmap=DIFFERENCE, vmin=-0.5, vmax=0.5)
        axis.set_title(f'observed − {title}', fontsize=10)
    figure.colorbar(difference, ax=axes[1], label='difference [share of stock]', shrink=0.9)
    return figure


def _plumes_without_gap(result: 'Diagnosis', part: 'HeldOut') -> Figure:
    figure, axes = _panels(result, 1, 3)
    shown = (part.observed[-1], part.before[-1])
    for axis, title, frame in zip(axes[0], ('observed', 'model as it is'), shown, strict=False):
        image = _map(axis, result, frame, cmap='viridis', vmin=0, vmax=1)
        axis.set_title(f'{title}, {part.times[-1] / 60:.0f} min', fontsize=10)
    figure.colorbar(image, ax=axes[0, :2], label='tracer [share of stock]', shrink=0.75)
    difference = _map(axes[0, 2], result, shown[0] - shown[1], cmap=DIFFERENCE, vmin=-0.5, vmax=0.5)
    axes[0, 2].set_title('observed − model', fontsize=10)
    figure.colorbar(difference, ax=axes[0, 2], label='difference [share of stock]', shrink=0.75)
    return figure


def gap(result: 'Diagnosis') -> Figure:
    """Return where the gap arises, with the effect's place, and where it shows in the end."""
    part = result.held_out[0]
    figure, axes = _panels(result, 1, 2)
    strength = PER_CENT_A_MINUTE * result.gap.strength
    top = max(float(strength.max()), DIM_GAP if result.verdict.name == NONE else 1e-3)
    image = _map(axes[0, 0], result, strength, cmap='inferno', vmin=0, vmax=top)
    axes[0, 0].set_title('where it arises', fontsize=10)
    figure.colorbar(image, ax=axes[0, 0], label='gap strength [% of stock per min]', shrink=0.8)
    wrong = _rms(part.observed - part.before)
    image = _map(axes[0, 1], result, wrong, cmap='inferno', vmin=0, vmax=0.5)
    axes[0, 1].set_title('where it shows: error of the model as it is, held out', fontsize=10)
    figure.colorbar(image, ax=axes[0, 1], label='rms error [share of stock]', shrink=0.8)
    if result.verdict.name != NONE:
        _spots(axes[0, 0], result)
        for axis in axes.flat:
            _places(axis, result)
    return figure


def remainder(result: 'Diagnosis') -> Figure:
    """Return what the best model leaves of the fitted and the held-out part, and beside noise."""
    part, sample = result.held_out[0], result.samples[0]
    _, early = before_and_after(_fitted_part(sample), result.verdict.model, result.numerics)
    late = part.after[np.searchsorted(part.times, sample.times[sample.fitted_frames :])]
    soft = part.blur
    left = sample.whitened(
        np.concatenate([early, late]), width=SMOOTHING_WIDTH, point_spread_width=soft
    )
    figure, axes = _panels(result, 1, 3)
    fitted = sample.observed[: sample.fitted_frames] - early
    parts = (('fitted part', fitted), ('held-out part', part.observed - part.after))
    for axis, (title, difference) in zip(axes[0], parts, strict=False):
        image = _map(axis, result, _mean(difference), cmap=DIFFERENCE, vmin=-0.25, vmax=0.25)
        axis.set_title(f'observed − best model, {title}', fontsize=9)
    figure.colorbar(image, ax=axes[0, :2], label='mean [share of stock]', shrink=0.75)
    beside = _rms(left)
    top = max(3.0, float(beside.max()))
    image = _map(axes[0, 2], result, beside, cmap='inferno', vmin=0, vmax=top)
    axes[0, 2].set_title('beside what noise would leave', fontsize=9)
    figure.colorbar(image, ax=axes[0, 2], label='rms [deviations]', shrink=0.75)
    return figure


def course(result: 'Diagnosis', number: int = 0) -> Figure:
    """Return error over time of recording `number` above what the pumps did."""
    data = error_course(result, number)
    sample = result.samples[number]
    figure = Figure(figsize=(12, 5.0), layout='constrained')
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    minutes = data.times / 60
    upper.plot(minutes, 100 * data.before, color=BEFORE, marker='.', label='model as it is')
    if result.verdict.name != NONE:
        label = _after_title(result)
        upper.plot(minutes, 100 * data.after, color=AFTER, marker='.', label=label)
    upper.fill_between(minutes, 100 * data.floor, color='0.85', label='noise alone')
    upper.set(
        ylabel='error of the map [%]',
        ylim=(0, 112 * float(max(data.before.max(), data.after.max()))),
    )
    upper.legend(frameon=False, ncols=3, loc='lower left', bbox_to_anchor=(0, 1), fontsize=9)
    for well in sample.schedule.wells:
        _rate_steps(lower, sample.schedule.intervals(sample.start, sample.end), well)
    lower.set(xlabel='time [min]', ylabel='rate [ml/h]')
    lower.axhline(0, color='0.7', lw=0.8)
    lower.legend(frameon=False, ncols=6, fontsize=8, loc='lower left', bbox_to_anchor=(0, 1))
    for axis in (upper, lower):
        axis.axvspan(data.held_out_start / 60, sample.end / 60, color='#e6eef6', zorder=0)
        axis.spines[['top', 'right']].set_visible(False)
    upper.annotate(
        'held out: no fit has seen this',
        (data.held_out_start / 60, 1.0),
        xycoords=('data', 'axes fraction'),
        xytext=(4, -12),
        textcoords='offset points',
        fontsize=9,
        color='#3a5a78',
    )
    return figure


def error_course(result: 'Diagnosis', number: int = 0) -> Course:
    """Return the error of every frame that the fits saw, and of every held-out one.

    Two simulations give the first part; the second is in the result.
    """
    sample, part = result.samples[number], result.held_out[number]
    early = _fitted_part(sample)
    before, after = before_and_after(early, result.verdict.model, result.numerics)
    observed = np.concatenate([early.observed, part.observed])
    before = np.concatenate([before, part.before])
    after = np.concatenate([after, part.after])
    soft = replace(sample.noise, point_spread_width=part.blur)
    norms = np.array([np.linalg.norm(np.nan_to_num(frame)) for frame in observed])
    clear = np.flatnonzero(norms > FAINT * norms.max())

    def errors(predicted: FloatArray) -> FloatArray:
        wrong = np.nan_to_num(predicted - observed)
        return np.array([np.linalg.norm(wrong[index]) / norms[index] for index in clear])

    floor = [noise_floor(soft, after[[index]], observed[[index]]) for index in clear]
    return Course(
        np.concatenate([early.times, part.times])[clear],
        errors(before),
        errors(after),
        np.array(floor),
        sample.held_out_start,
    )


def _fitted_part(sample: Sample) -> Sample:
    end = sample.fitted_frames
    return replace(sample, times=sample.times[:end], observed=sample.observed[:end])


def _panels(result: 'Diagnosis', rows: int, columns: int) -> tuple[Figure, Any]:
    rig = result.recordings[0].rig
    height = 10.0 / columns * rig.height_m / rig.width_m + 0.65
    figure = Figure(figsize=(12, rows * height), layout='constrained')
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axis in axes[-1]:
        axis.set_xlabel('x [m]', fontsize=9)
    for axis in axes[:, 0]:
        axis.set_ylabel('z [m]', fontsize=9)
    return figure, axes


def _map(axis: Axes, result: 'Diagnosis', values: FloatArray, **style: Any) -> Any:
    rig = result.recordings[0].rig
    extent = (0.0, rig.width_m, 0.0, rig.height_m)
    image = axis.imshow(values, origin='lower', extent=extent, **style)
    axis.set_facecolor('0.6')
    _sands(axis, result)
    _wells(axis, result, dark=style['cmap'] != DIFFERENCE)
    return image


def _sands(axis: Axes, result: 'Diagnosis') -> None:
    """Draw where the believed sand changes."""
    rig, grid = result.recordings[0].rig, result.recordings[0].grid
    sand = np.log10(rig.field('permeability_m2', grid))
    if np.ptp(sand) > 0.01:
        axis.contour(grid.x, grid.z, sand, 6, colors='0.6', linewidths=0.4, linestyles='-')


def _wells(axis: Axes, result: 'Diagnosis', *, dark: bool = False) -> None:
    ink, ground = ('w', 'k') if dark else ('k', 'w')
    rig = result.recordings[0].rig
    for name, well in rig.wells.items():
        axis.plot(well.x_m, well.z_m, 'o', ms=4, mfc='w', mec='k', mew=0.8)
        right = well.x_m > 0.8 * rig.width_m
        axis.annotate(
            name,
            (well.x_m, well.z_m),
            xytext=(-4 if right else 4, 3),
            textcoords='offset points',
            ha='right' if right else 'left',
            fontsize=7,
            color=ink,
            path_effects=[withStroke(linewidth=2, foreground=ground, alpha=0.5)],
        )
    axis.tick_params(labelsize=8)
    axis.set(xlim=(0, rig.width_m), ylim=(0, rig.height_m), aspect='equal')


def _fronts(axis: Axes, result: 'Diagnosis', part: 'HeldOut') -> None:
    """Draw where the three maps hold half the stock."""
    rig = result.recordings[0].rig
    grid = rig.grid(*part.observed.shape[:0:-1])
    shown = (
        (part.observed[-1], SEEN, '-', 2.4, 'observed'),
        (part.before[-1], BEFORE, '--', 1.2, 'as it is'),
        (part.after[-1], AFTER, '-', 1.0, _after_title(result).removeprefix('model ')),
    )
    for frame, colour, line, width, label in shown:
        if np.nanmax(frame) > 0.5:
            axis.contour(
                grid.x, grid.z, frame, [0.5], colors=colour, linestyles=line, linewidths=width
            )
        axis.plot([], [], color=colour, ls=line, lw=width, label=label)
    _sands(axis, result)
    _wells(axis, result)
    axis.set(xlim=(0, rig.width_m), ylim=(0, rig.height_m))
    axis.legend(
        fontsize=7.5,
        loc='lower center',
        bbox_to_anchor=(0.5, 0.98),
        ncols=3,
        frameon=False,
        columnspacing=1.0,
        handlelength=1.5,
    )


def _spots(axis: Axes, result: 'Diagnosis') -> None:
    for spot in result.gap.spots:
        axis.add_patch(Circle((spot.x, spot.z), spot.radius, fill=False, ec='w', lw=1.0, ls=':'))
        axis.annotate(
            f'{spot.share:.0%}',
            (spot.x + 0.7 * spot.radius, spot.z + 0.7 * spot.radius),
            color='w',
            fontsize=8,
            annotation_clip=True,
        )


def _places(axis: Axes, result: 'Diagnosis') -> None:
    """Mark the place of every kept effect that has one."""
    if not result.verdict.members:
        return
    rig = result.recordings[0].rig
    for effect in result.verdict.model.effects:
        p = effect.parameters
        if 'x' in p:
            place = (float(p['x']), float(p['z']))
            axis.plot(*place, '+', color='c', ms=14, mew=2)
            if 'radius' in p:
                axis.add_patch(Circle(place, float(p['radius']), fill=False, ec='c', lw=1.6))
        elif 'well' in p:
            well = rig.wells[str(p['well'])]
            place = (well.x_m + float(p.get('dx', 0.0)), well.z_m + float(p.get('dz', 0.0)))
            axis.plot(*place, 'o', ms=11, mfc='none', mec='c', mew=2)


def _rate_steps(axis: Axes, intervals: Any, well: str) -> None:
    """Draw the rate of `well`: thick where it injects tracer."""
    parts = [(start, end, rates.get(well)) for start, end, rates in intervals]
    edges = [parts[0][0], *(end for _, end, _ in parts)]
    rates = [0.0 if rate is None else to_ml_h(rate.rate) for _, _, rate in parts]
    (line,) = axis.step(np.array(edges) / 60, [*rates, rates[-1]], where='post', lw=1.2, label=well)
    for start, end, rate in parts:
        if rate is not None and rate.rate > 0 and rate.concentration > 0:
            level = to_ml_h(rate.rate)
            axis.plot([start / 60, end / 60], [level, level], lw=4, color=line.get_color())


def _after_title(result: 'Diagnosis') -> str:
    return 'mended model' if result.verdict.members else 'best model'


def _mean(values: FloatArray) -> FloatArray:
    """Return the mean over time where anything is known, else NaN."""
    known = np.isfinite(values).sum(axis=0)
    return np.where(known > 0, np.nansum(values, axis=0) / np.maximum(known, 1), np.nan)


def _rms(values: FloatArray) -> FloatArray:
    return np.sqrt(_mean(values**2))
