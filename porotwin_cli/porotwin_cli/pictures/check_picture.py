"""One picture of a rig: sands, wells, zones, and the photograph with the corners drawn over it."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use('Agg')

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from porotwin_cli.checking.rig_check import CheckedRig
from porotwin_cli.options.output_files import maker
from porotwin_cli.pictures.rig_drawing import ZONE_STYLES, draw_zones
from porotwin_core.basis.errors import InputError, writing
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.rig.control_zones import control_zones
from porotwin_core.rig.rig_on_axes import DOTS_PER_INCH, WATER, draw_water, water_place
from porotwin_core.rig.sand_interfaces import MOST_SANDS, sand_level
from porotwin_imaging.geometry.corners_and_lens import Geometry

WIDTH_IN = 10.0
"""Width of the picture [inches]."""

SAND = plt.get_cmap('YlOrBr')
"""Colours of the sands: light is fine, dark is coarse, as in most rigs."""

SHADES = (0.03, 0.6)
"""Part of the colours that is used: names and zones are still seen on the darkest."""


SHADED_PERCENTILES = (2.0, 98.0)
"""Percentiles of a map of permeabilities between which the shades are spread."""

Shading = Callable[[Any], FloatArray]
"""Returns the shade [-] of permeabilities [m^2]."""

ZONE, CHART = '#b03a2e', '#1e8449'
ROLES = {'control': '#2471a3', 'fixed': '#1e8449', 'producer': '#7d3c98', 'other': '#555555'}
FLOWS = {'injects stock': '#b03a2e', 'injects water': '#2471a3', 'takes out': '#7d3c98'}
COLOURS = {**ROLES, **FLOWS}
"""Colours of wells by their part in a control section, and in a recording."""

CORNERS = ('upper left', 'lower left', 'lower right', 'upper right')
LABEL_BOX = {'facecolor': 'white', 'alpha': 0.7, 'lw': 0, 'pad': 1}
BESIDE_LEGEND = 0.72
"""Share of the width that the legend leaves to the rig."""

LINES_SHOWN = 8
"""Most remarks below the picture; the command prints all."""

LINE_CHARACTERS = 125
"""Characters of a line below the picture."""

LINE_IN = 0.15
"""Height of such a line [inches]."""


def check_picture(path: Path, checked: CheckedRig, words: Sequence[str] = ()) -> None:
    """Draw `checked` into the PNG file `path`, with its remarks and further `words` below it."""
    lines = _lines(checked, words)
    heights = [WIDTH_IN * BESIDE_LEGEND * _flat(checked.rig.height_m / checked.rig.width_m)]
    if checked.photograph is not None:
        rows, columns = checked.photograph.shape[:2]
        heights.append(WIDTH_IN * 0.86 * _flat(rows / columns))
    text = LINE_IN * (len(lines) + 1)
    figure = Figure(figsize=(WIDTH_IN, sum(heights) + 0.9 * len(heights) + text))
    figure.set_layout_engine('constrained')
    axes = figure.subplots(len(heights) + 1, 1, squeeze=False, height_ratios=[*heights, text])[:, 0]
    roles = well_roles(checked)
    _draw_rig(axes[0], checked.rig, roles)
    _draw_effects(axes[0], checked.effects)
    if checked.photograph is not None:
        _draw_photograph(axes[1], checked, roles)
    axes[-1].axis('off')
    axes[-1].text(0.0, 1.0, '\n'.join(lines), va='top', fontsize=8, transform=axes[-1].transAxes)
    with writing(path):
        figure.savefig(
            path, dpi=DOTS_PER_INCH, bbox_inches='tight', metadata={'Software': maker('check')}
        )


def _flat(ratio: float) -> float:
    """Return height over width, within the limits of a page."""
    return min(max(ratio, 0.2), 1.5)


def _lines(checked: CheckedRig, words: Sequence[str]) -> list[str]:
    rows = [str(remark) for remark in checked.remarks] or ['nothing odd']
    more = len(rows) - LINES_SHOWN
    rows = rows[:LINES_SHOWN] + ([f'and {more} more'] if more > 0 else [])
    return [line for row in (*rows, *words) for line in textwrap.wrap(row, LINE_CHARACTERS)]


def _draw_rig(axis: Axes, rig: Rig, roles: Mapping[str, str]) -> None:
    permeability = np.atleast_2d(np.asarray(rig.nominal_map('permeability_m2'), dtype=float))
    shade = shading(permeability)
    extent = (0.0, rig.width_m, 0.0, rig.height_m)
    axis.imshow(SAND(shade(permeability)), origin='lower', extent=extent, interpolation='nearest')
    handles = _sand_handles(rig, shade)
    _draw_depth(axis, rig)
    _draw_sides(axis, rig)
    draw_zones(axis, rig)
    for name, well in rig.wells.items():
        colour = COLOURS[roles[name]]
        axis.add_patch(Circle((well.x_m, well.z_m), well.radius_m, color=colour))
        axis.plot(well.x_m, well.z_m, 'o', mfc='none', mec=colour, ms=11)
        axis.annotate(name, (well.x_m, well.z_m), (8, 6), textcoords='offset points', fontsize=8)
    axis.set(xlabel='x [m]', ylabel='z [m]')
    axis.set_title(f'{rig.name}: {rig.width_m:g} m x {rig.height_m:g} m, {_depth_words(rig)}')
    margin = 0.02 * rig.width_m
    axis.set_xlim(-margin, rig.width_m + margin)
    axis.set_ylim(-margin, rig.height_m + margin)
    axis.legend(
        handles=[*handles, *_role_handles(rig, roles)], fontsize=7, loc='upper left',
        bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0,
    )  # fmt: skip


def _draw_effects(axis: Axes, effects: Sequence[EffectDescription]) -> None:
    """Mark the effects that have a place, such as a leak."""
    for effect in effects:
        if {'x', 'z'} <= effect.parameters.keys():
            place = float(effect.parameters['x']), float(effect.parameters['z'])
            axis.plot(*place, 'x', color='black', ms=9, mew=2)
            axis.annotate(effect.name, place, (8, 6), textcoords='offset points', fontsize=8)


def shading(permeability: FloatArray) -> Shading:
    """Return the shading of a map of permeabilities [m^2].

    Sands have evenly spread shades in the order of their permeabilities, so that one extreme sand
    does not make the others alike. Between two sands, and in a map of many values, the shade
    follows the logarithm.
    """
    levels = np.unique(sand_level(permeability))
    if len(levels) > MOST_SANDS:
        levels = np.percentile(np.log(permeability), SHADED_PERCENTILES)
    shades = np.linspace(*SHADES, len(levels)) if len(levels) > 1 else np.array([np.mean(SHADES)])
    return lambda values: np.asarray(np.interp(np.log(values), levels, shades))


def _sand_handles(rig: Rig, shade: Shading) -> list[Patch]:
    def patch(permeability: float, label: str) -> Patch:
        colour = SAND(float(shade(permeability)))
        return Patch(facecolor=colour, edgecolor='grey', label=label)

    if rig.sands:
        return [
            patch(
                k := rig.permeability_of_sand(name),
                f'{name}: {k:.3g} m$^2$, porosity {sand.porosity:g}',
            )
            for name, sand in rig.sands.items()
        ]
    values = np.unique(rig.nominal_map('permeability_m2'))
    chosen = values if len(values) <= 6 else values[[0, len(values) // 2, -1]]
    return [patch(float(k), f'{k:.3g} m$^2$') for k in chosen]


def _role_handles(rig: Rig, roles: Mapping[str, str]) -> list[Line2D]:
    handles = [
        Line2D([], [], marker='o', ls='', mfc='none', mec=COLOURS[role], label=f'well: {role}')
        for role in dict.fromkeys(roles.values())
    ]
    handles += [
        Line2D([], [], color=ZONE_STYLES[kind][0], label=f'zone: {kind}')
        for kind in dict.fromkeys(zone.kind for zone in control_zones(rig))
    ]
    if not rig.closed:
        handles.append(Line2D([], [], color=WATER, lw=4, label='water'))
    return handles


def well_roles(checked: CheckedRig) -> dict[str, str]:
    """Return the part of every well: in the control section, or else in the recording."""
    rates = (checked.data and checked.data.known_rates) or Schedule()
    roles = {name: _role(checked.rig, name) for name in checked.rig.wells}
    return {
        name: _flow([row.rate for row in rates.rows if row.well == name])
        if role == 'other'
        else role
        for name, role in roles.items()
    }


def _flow(rates: Sequence[WellRate]) -> str:
    """Return the part of a well with these `rates` in a recording."""
    injected = [rate.concentration for rate in rates if rate.rate > 0.0]
    if injected:
        return 'injects stock' if max(injected) > 0.0 else 'injects water'
    return 'takes out' if any(rate.rate < 0.0 for rate in rates) else 'other'


def _role(rig: Rig, name: str) -> str:
    control = rig.control
    if control is None:
        return 'other'
    if name in control.wells:
        return 'control'
    if name in control.fixed:
        return 'fixed'
    return 'producer' if name == control.producer else 'other'


def _depth_words(rig: Rig) -> str:
    depth = np.asarray(rig.nominal_map('depth_m')) * 1e3
    return f'depth {depth.min():.3g} mm' + (
        f' to {depth.max():.3g} mm' if depth.max() > depth.min() else ''
    )


def _draw_depth(axis: Axes, rig: Rig) -> None:
    depth = np.asarray(rig.nominal_map('depth_m'))
    if depth.ndim == 0 or min(depth.shape) < 2 or depth.max() == depth.min():
        return
    grid = rig.grid(depth.shape[1], depth.shape[0])
    lines = axis.contour(grid.x, grid.z, depth * 1e3, colors='black', linewidths=0.4, alpha=0.6)
    axis.clabel(lines, fmt='%.3g mm', fontsize=6)


def _draw_sides(axis: Axes, rig: Rig) -> None:
    width, height = rig.width_m, rig.height_m
    axis.plot([0, width, width, 0, 0], [0, 0, height, height, 0], color='black', lw=1.5)
    draw_water(axis, rig)
    inward = {'bottom': (0, 12), 'top': (0, -12), 'left': (12, 0), 'right': (-12, 0)}
    for name, body in rig.water_bodies.items():
        told = f'{body.rate_ml_h:g} ml/h' if body.head_m is None else f'{body.head_m:g} m'
        words = f'{name} {told}'
        middle = np.mean(water_place(rig, name), axis=0)
        if body.side is None:
            _label(axis, words, middle, (0, 0), 0)
        elif body.side not in rig.boundaries.open_sides or rig.boundaries.heads_m:
            along_z = body.side in ('left', 'right')
            _label(axis, words, middle, inward[body.side], 90 if along_z else 0)


def _label(
    axis: Axes, words: str, place: FloatArray, offset: tuple[int, int], rotation: int
) -> None:
    axis.annotate(
        words,
        (float(place[0]), float(place[1])),
        xytext=offset,
        textcoords='offset points',
        color=WATER,
        ha='center',
        va='center',
        rotation=rotation,
        bbox={'boxstyle': 'round,pad=0.2', 'facecolor': 'white', 'edgecolor': 'none'},
    )


def _draw_photograph(axis: Axes, checked: CheckedRig, roles: Mapping[str, str]) -> None:
    rig, camera = checked.rig, checked.rig.camera
    assert camera is not None
    assert checked.photograph is not None
    axis.imshow(checked.photograph)
    corners = np.array(camera.corners_px)
    axis.plot(*np.vstack([corners, corners[:1]]).T, color=ZONE, lw=1.0)
    for name, corner in zip(CORNERS, camera.corners_px, strict=True):
        axis.plot(*corner, '+', color=ZONE, ms=14, mew=2)
        axis.annotate(
            name,
            corner,
            fontsize=8,
            color=ZONE,
            ha='left' if 'left' in name else 'right',
            va='top' if 'upper' in name else 'bottom',
            bbox=LABEL_BOX,
        )
    if camera.colour_checker_px is not None:
        chart = np.array(camera.colour_checker_px)
        axis.plot(*np.vstack([chart, chart[:1]]).T, color=CHART, lw=1.2)
    for place_px in camera.references_px:
        axis.plot(*np.array([*place_px, place_px[0]]).T, color=CHART, lw=1.2)
    try:
        geometry = Geometry.of(rig)
    except InputError:
        return
    for name, well in rig.wells.items():
        column, row = geometry.to_pixels(np.array(well.x_m), np.array(well.z_m))
        place = (float(column), float(row))
        axis.plot(*place, 'o', mfc='none', mec='white', ms=11, mew=4)
        axis.plot(*place, 'o', mfc='none', mec=COLOURS[roles[name]], ms=11, mew=2)
        axis.annotate(name, place, (8, 6), textcoords='offset points', fontsize=8, bbox=LABEL_BOX)
    for kind, zone in control_zones(rig):
        for outline in zone.outlines:
            line = geometry.to_pixels(outline[:, 0], outline[:, 1])
            axis.plot(*line, color=ZONE_STYLES[kind][0], lw=1.2)
    axis.set(xlabel='column [px]', ylabel='row [px]')
    axis.set_title('the rig in the first baseline photograph')
