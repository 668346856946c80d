"""The figures of the report: plumes, where the gap arises, the error over time, the remainder."""

import textwrap
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke

from porotwin_core.basis.units import percent, to_ml_h
from porotwin_core.clock.time_units import TimeUnit, time_unit
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig
from porotwin_core.rig.rig_on_axes import draw_interfaces, draw_water, draw_wells
from porotwin_core.rig.well_colours import well_colours
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH
from porotwin_diagnosis.decision.held_out import HeldOut
from porotwin_diagnosis.decision.numerics import before_and_after
from porotwin_diagnosis.decision.verdict import NONE
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.effect_traits import is_of_camera
from porotwin_diagnosis.report.error_course import ErrorCourse, error_course, fitted_part

LEAST_COLOUR_TOP = 1.0
"""Least upper end of the gap's colours where there is no gap, so that noise stays dark [% of stock
per minute, hour or day]. Maps of long recordings lie further apart, so their noise grows slower."""

CONCENTRATION = {'cmap': 'viridis', 'vmin': 0.0, 'vmax': 1.0}
"""Colours of a concentration, relative to the tracer stock."""

DIFFERENCE_COLOURS = 'RdBu_r'
"""Colours of a difference: red where more was observed than predicted, blue where less."""

DIFFERENCE = {'cmap': DIFFERENCE_COLOURS, 'vmin': -0.5, 'vmax': 0.5}
MEAN_DIFFERENCE = {'cmap': DIFFERENCE_COLOURS, 'vmin': -0.25, 'vmax': 0.25}
"""Colours of a difference at one time, and of a mean over time, which is smaller."""

LEAST_DEVIATIONS_TOP = 3.0
"""Least upper end of the colours of whitened residuals, in standard deviations."""

INTERFACES = '0.6'
"""Colour of the interfaces between sands."""

BEFORE, AFTER, OBSERVED = '#c8402f', '#1f6fb4', '0.15'
"""Line colours of the model before and after, and of the observation."""

MOST_HEIGHT = 7.5
"""Greatest height of a figure of maps [inch]: 680 pixels on the page, which fit a screen."""

MARGIN, BESIDE_PANEL, BELOW_PANEL = 0.65, 1.3, 0.75
"""Space for titles and labels above and below a map, for labels and a colour bar beside it, and for
a colour bar below it [inch]."""

LEAST_BAR = 1.7
"""Height of a map from which on a colour bar with its label stands beside it [inch]."""

TALL = 1.8
"""Height over width from which on a rig is tall."""

LETTERS_PER_INCH = 9.0
"""Letters of a title in an inch; some of its width belongs to labels and colour bars."""

FRONT = 0.5
"""Concentration of the line that is drawn as a front, relative to the stock."""


class Panels(NamedTuple):
    """A `figure` of maps.

    Attributes:
        figure: the figure.
        bars_beside: whether colour bars stand beside the maps; below flat ones, because their
            labels are longer than such maps are high.
        letters: number of letters in a line of a title.
    """

    figure: Figure
    bars_beside: bool
    letters: int

    def bar(self, image: Any, axes: Any, label: str, shrink: float = 0.8) -> None:
        """Draw the colour bar of `image` for `axes`."""
        if self.bars_beside:
            self.figure.colorbar(image, ax=axes, label=label, shrink=shrink)
        else:
            self.figure.colorbar(
                image, ax=axes, label=label, location='bottom', shrink=0.5, aspect=40
            )

    def title(self, axis: Axes, words: str) -> None:
        """Give `axis` a title, in as many lines as it needs."""
        axis.set_title('\n'.join(textwrap.wrap(words, self.letters)), fontsize=10)


def plumes(result: Diagnosis, number: int = 0) -> Figure:
    """Return the last map of recording `number`: observed, before, after, and the differences."""
    part = result.held_out[number]
    if result.verdict.name == NONE:
        return _plumes_without_gap(result, part)
    observed, before, after = part.observed[-1], part.before[-1], part.after[-1]
    panels, axes = _panels(result, 2, 3)
    titles = ('observed', 'model as it is', _after_title(result))
    for axis, title, shown in zip(axes[0], titles, (observed, before, after), strict=True):
        image = _map(axis, result, shown, **CONCENTRATION)
        panels.title(axis, f'{title}, {time_unit(part.times[-1]).text(part.times[-1])}')
    panels.bar(image, axes[0], 'tracer [share of stock]', 0.9)
    _fronts(axes[1, 0], result, part, columns=3 if panels.letters > 30 else 1)
    for axis, title, shown in zip(axes[1, 1:], titles[1:], (before, after), strict=True):
        difference = _map(axis, result, observed - shown, **DIFFERENCE)
        panels.title(axis, f'observed − {title}')
    panels.bar(difference, axes[1], 'difference [share of stock]', 0.9)
    return panels.figure


def _plumes_without_gap(result: Diagnosis, part: HeldOut) -> Figure:
    panels, axes = _panels(result, 1, 3)
    shown = (part.observed[-1], part.before[-1])
    for axis, title, frame in zip(axes[0], ('observed', 'model as it is'), shown, strict=False):
        image = _map(axis, result, frame, **CONCENTRATION)
        panels.title(axis, f'{title}, {time_unit(part.times[-1]).text(part.times[-1])}')
    panels.bar(image, axes[0, :2], 'tracer [share of stock]', 0.75)
    difference = _map(axes[0, 2], result, shown[0] - shown[1], **DIFFERENCE)
    panels.title(axes[0, 2], 'observed − model')
    panels.bar(difference, axes[0, 2], 'difference [share of stock]', 0.75)
    return panels.figure


def where(result: Diagnosis) -> Figure:
    """Return the map of the origin of the gap, with hot spots and the place of the effect."""
    panels, axes = _panels(result, 1, 1, width=7.0)
    _draw_strength(panels, axes[0, 0], result, 'where the gap arises')
    _spots(axes[0, 0], result)
    _places(axes[0, 0], result)
    return panels.figure


def gap(result: Diagnosis) -> Figure:
    """Return the map of the final error of the model.

    If the gap has no place in the rig, the map of one-step errors stands beside it, because the
    first screen then lacks it.
    """
    part = result.held_out[0]
    alone = arises_in_rig(result)
    panels, axes = _panels(result, 1, 1 if alone else 2, width=7.0 if alone else 12.0)
    if not alone:
        named = result.verdict.name != NONE
        title = 'fronts that the camera changes' if named else 'error of one short step'
        _draw_strength(panels, axes[0, 0], result, title)
    wrong = _rms(part.observed - part.before)
    image = _map(axes[0, -1], result, wrong, cmap='inferno', vmin=0, vmax=0.5)
    panels.title(axes[0, -1], 'error of the model as it is, held-out part')
    panels.bar(image, axes[0, -1], 'rms error [share of stock]')
    if alone:
        _places(axes[0, -1], result)
    return panels.figure


def arises_in_rig(result: Diagnosis) -> bool:
    """Return whether there is a gap with a place in the rig, not one from the camera."""
    members = result.verdict.members
    of_camera = bool(members) and all(is_of_camera(name) for name in members)
    return result.verdict.name != NONE and not of_camera


def _draw_strength(panels: Panels, axis: Axes, result: Diagnosis, title: str) -> None:
    unit = time_unit(result.samples[0].duration)
    strength = 100.0 * unit.seconds * result.gap.strength
    top = max(float(strength.max()), LEAST_COLOUR_TOP if result.verdict.name == NONE else 1e-3)
    image = _map(axis, result, strength, cmap='inferno', vmin=0, vmax=top)
    panels.title(axis, title)
    panels.bar(image, axis, f'gap strength [% of stock per {unit.name}]')


def remainder(result: Diagnosis) -> Figure:
    """Return the residual of the best model: fitted part, held-out part, and relative to noise."""
    part, sample = result.held_out[0], result.samples[0]
    early_part = fitted_part(sample)
    _, early = before_and_after(early_part, result.verdict.model, result.evidence.numerics)
    late = part.after[np.searchsorted(part.times, sample.times[sample.fitted_frames :])]
    whitened = sample.whitened(
        np.concatenate([early, late]),
        width=SMOOTHING_WIDTH,
        point_spread_width=part.point_spread_width,
    )
    panels, axes = _panels(result, 1, 3)
    fitted = early_part.observed - early
    parts = (('fitted part', fitted), ('held-out part', part.observed - part.after))
    for axis, (title, difference) in zip(axes[0], parts, strict=False):
        image = _map(axis, result, _mean(difference), **MEAN_DIFFERENCE)
        panels.title(axis, f'observed − best model, {title}')
    panels.bar(image, axes[0, :2], 'mean [share of stock]', 0.75)
    deviations = _rms(whitened)
    top = max(LEAST_DEVIATIONS_TOP, float(deviations.max()))
    image = _map(axes[0, 2], result, deviations, cmap='inferno', vmin=0, vmax=top)
    panels.title(axes[0, 2], 'relative to the noise')
    panels.bar(image, axes[0, 2], 'rms [standard deviations]', 0.75)
    return panels.figure


def course(result: Diagnosis, number: int = 0) -> Figure:
    """Return the error over time of recording `number`, above the rates of the pumps."""
    data = error_course(result, number)
    sample = result.samples[number]
    figure = Figure(figsize=(12, 5.0), layout='constrained')
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    unit = time_unit(sample.duration)
    _draw_errors(upper, result, data, unit)
    rates = list(sample.schedule.intervals(sample.start, sample.end))
    for well, colour in well_colours(result.recordings[number].rig).items():
        if well in sample.schedule.wells:
            _draw_rates(lower, rates, well, colour, unit)
    lower.set(xlabel=f'time [{unit.name}]', ylabel='rate [ml/h]')
    lower.axhline(0, color='0.7', lw=0.8)
    lower.legend(frameon=False, ncols=6, fontsize=8, loc='lower left', bbox_to_anchor=(0, 1))
    start = data.held_out_start / unit.seconds
    for axis in (upper, lower):
        axis.axvspan(start, sample.end / unit.seconds, color='#e6eef6', zorder=0)
        axis.spines[['top', 'right']].set_visible(False)
    upper.annotate(
        'held out: no fit has seen this part',
        (start, 1.0),
        xycoords=('data', 'axes fraction'),
        xytext=(4, -12),
        textcoords='offset points',
        fontsize=9,
        color='#3a5a78',
    )
    return figure


def _draw_errors(axis: Axes, result: Diagnosis, data: ErrorCourse, unit: TimeUnit) -> None:
    times = data.times / unit.seconds
    # wide: the other line may have the same values, and both must be seen
    axis.plot(times, 100 * data.before, color=BEFORE, marker='.', lw=4, label='model as it is')
    if result.verdict.name != NONE:
        label = _after_title(result)
        axis.plot(times, 100 * data.after, color=AFTER, marker='.', label=label)
    axis.fill_between(times, 100 * data.floor, color='0.85', label='noise alone')
    largest = float(max(data.before.max(), data.after.max()))
    axis.set(ylabel='error of the map [%]', ylim=(0, 112 * largest))
    axis.legend(frameon=False, ncols=3, loc='lower left', bbox_to_anchor=(0, 1), fontsize=9)


def _draw_rates(
    axis: Axes,
    intervals: Iterable[tuple[float, float, WellRates]],
    well: str,
    colour: str,
    unit: TimeUnit,
) -> None:
    """Draw the rate of `well` over time in its `colour`, thick where it injects tracer."""
    parts = [(start, end, rates.get(well)) for start, end, rates in intervals]
    edges = np.array([parts[0][0], *(end for _, end, _ in parts)]) / unit.seconds
    rates = [0.0 if rate is None else to_ml_h(rate.rate) for _, _, rate in parts]
    axis.step(edges, [*rates, rates[-1]], where='post', lw=1.2, color=colour, label=well)
    for start, end, (_, _, rate) in zip(edges[:-1], edges[1:], parts, strict=True):
        if rate is not None and rate.rate > 0 and rate.concentration > 0:
            level = to_ml_h(rate.rate)
            axis.plot([start, end], [level, level], lw=4, color=colour)


def _panels(result: Diagnosis, rows: int, columns: int, width: float = 12.0) -> tuple[Panels, Any]:
    """Return a figure of at most `width` [inch] and its axes (rows, columns), shaped like the rig.

    The figure fits a screen: the rows of a tall rig stand side by side.
    """
    rig = result.recordings[0].rig
    ratio = rig.height_m / rig.width_m
    drawn = (1, rows * columns) if is_tall(rig) else (rows, columns)
    natural = width / 1.2 / drawn[1] * ratio
    panel = min(natural, MOST_HEIGHT / drawn[0] - MARGIN)
    width = min(width, drawn[1] * (1.2 * panel / ratio + BESIDE_PANEL))
    beside = panel >= LEAST_BAR
    figure = Figure(
        figsize=(width, drawn[0] * (panel + MARGIN + (0.0 if beside else BELOW_PANEL))),
        layout='constrained',
    )
    axes = figure.subplots(*drawn, sharex=True, sharey=True, squeeze=False)
    for axis in axes[-1]:
        axis.set_xlabel('x [m]', fontsize=9)
    for axis in axes[:, 0]:
        axis.set_ylabel('z [m]', fontsize=9)
    letters = int(LETTERS_PER_INCH * width / drawn[1])
    return Panels(figure, bars_beside=beside, letters=letters), axes.reshape(rows, columns)


def is_tall(rig: Rig) -> bool:
    """Return whether the maps of `rig` stand side by side in one row."""
    return rig.height_m > TALL * rig.width_m


def _map(axis: Axes, result: Diagnosis, values: FloatArray, **style: Any) -> Any:
    """Draw `values` (nz, nx) with the sands and wells of the rig; return the image."""
    rig = result.recordings[0].rig
    extent = (0.0, rig.width_m, 0.0, rig.height_m)
    image = axis.imshow(values, origin='lower', extent=extent, **style)
    axis.set_facecolor('0.6')
    draw_interfaces(axis, rig, colour=INTERFACES)
    _wells(axis, result, dark=style['cmap'] != DIFFERENCE_COLOURS)
    return image


def _wells(axis: Axes, result: Diagnosis, *, dark: bool = False) -> None:
    """Draw the wells and the limits of the rig, with names in white on a `dark` map."""
    rig = result.recordings[0].rig
    draw_water(axis, rig)
    draw_wells(axis, rig, dark=dark)
    axis.tick_params(labelsize=8)
    axis.set(xlim=(0, rig.width_m), ylim=(0, rig.height_m), aspect='equal')


def _fronts(axis: Axes, result: Diagnosis, part: HeldOut, *, columns: int) -> None:
    """Draw the fronts of the last three maps: observed, before and after.

    The legend above has that many `columns`.
    """
    rig = result.recordings[0].rig
    grid = rig.grid(*part.observed.shape[:0:-1])
    shown = (
        (part.observed[-1], OBSERVED, '-', 2.4, 'observed'),
        (part.before[-1], BEFORE, '--', 1.2, 'as it is'),
        (part.after[-1], AFTER, '-', 1.0, _after_title(result).removeprefix('model ')),
    )
    for frame, colour, line, width, label in shown:
        if np.nanmax(frame) > FRONT:
            axis.contour(
                grid.x, grid.z, frame, [FRONT], colors=colour, linestyles=line, linewidths=width
            )
        axis.plot([], [], color=colour, ls=line, lw=width, label=label)
    draw_interfaces(axis, rig, colour=INTERFACES)
    _wells(axis, result)
    axis.legend(
        fontsize=7.5,
        loc='lower center',
        bbox_to_anchor=(0.5, 1.0),
        ncols=columns,
        frameon=False,
        columnspacing=1.0,
        handlelength=1.5,
    )


def _spots(axis: Axes, result: Diagnosis) -> None:
    """Draw the hot spots of the gap with their shares, beside their middles, where wells are."""
    height = result.recordings[0].rig.height_m
    for spot in result.gap.spots:
        axis.add_patch(Circle((spot.x, spot.z), spot.radius, fill=False, ec='w', lw=1.0, ls=':'))
        above = spot.z + spot.radius < 0.9 * height
        axis.annotate(
            percent(spot.share),
            (spot.x, spot.z + (spot.radius if above else -spot.radius)),
            ha='center',
            va='bottom' if above else 'top',
            color='w',
            fontsize=8,
            annotation_clip=True,
            path_effects=[withStroke(linewidth=2, foreground='k', alpha=0.5)],
        )


def _places(axis: Axes, result: Diagnosis) -> None:
    """Mark the place of every named effect that has one."""
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


def _after_title(result: Diagnosis) -> str:
    return 'corrected model' if result.verdict.members else 'best model'


def _mean(values: FloatArray) -> FloatArray:
    """Return the mean of `values` (nt, nz, nx) over the times that are known, else NaN."""
    known = np.isfinite(values).sum(axis=0)
    return np.where(known > 0, np.nansum(values, axis=0) / np.maximum(known, 1), np.nan)


def _rms(values: FloatArray) -> FloatArray:
    """Return the root mean square of `values` (nt, nz, nx) over the times that are known."""
    return np.sqrt(_mean(values**2))
