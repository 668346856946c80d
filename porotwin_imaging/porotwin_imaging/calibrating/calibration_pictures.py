"""The calibration file, and pictures of each step for a person who checks the calibration."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from porotwin_core.basis.errors import writing
from porotwin_core.basis.whole_folder import whole_folder
from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.calibrating.calibration_evidence import SOURCES, Anchor
from porotwin_imaging.calibrating.calibration_fit import CalibrationFit
from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused, refusal
from porotwin_imaging.light.colour_checker import REFERENCE
from porotwin_imaging.tracer.calibration import save_calibration
from porotwin_imaging.tracer.calibration_keys import FILE_NAME

Array = NDArray[Any]

REFUSED = 'refused.txt'
"""File with the reasons beside the pictures of a refused calibration."""
_REASONS_SEEN = '6_mass.png'
"""Picture that shows the reasons of most refusals."""


def write_fit(fit: CalibrationFit, folder: Path) -> list[Path]:
    """Write calibration.yaml and a picture of every step into `folder`; return the pictures.

    The files are made in a hidden folder beside it, so that an interruption leaves no part of a
    calibration. They replace those of an earlier refusal.

    Raises:
        CalibrationRefused: the calibration cannot be trusted. The pictures are written and show
            why; `REFUSED` holds the line, and there is no calibration.yaml.
        InputError: the folder may not be written.
        OSError: the disk is full or fails.
    """
    refused = any(one.refused for one in fit.remarks)
    with writing(folder):
        with whole_folder(folder, replaces=True) as unfinished:
            pictures = draw_fit(fit, unfinished)
            if refused:
                reasons = refusal(fit.remarks) + '\n'
                (unfinished / REFUSED).write_text(reasons, encoding='utf-8')
            else:
                save_calibration(fit.calibration, unfinished / FILE_NAME)
        # last, because the next call may write a folder that holds REFUSED
        (folder / (FILE_NAME if refused else REFUSED)).unlink(missing_ok=True)
    if refused:
        raise CalibrationRefused(refusal(fit.remarks), fit.lines, folder / _REASONS_SEEN)
    return [folder / picture.name for picture in pictures]


def draw_fit(fit: CalibrationFit, folder: Path) -> list[Path]:
    """Write a picture of every step into `folder` and return their paths."""
    steps: dict[str, Callable[[Any], None]] = {
        '1_geometry.png': lambda axes: _geometry(axes, fit),
        '2_colour_checker.png': lambda axes: _checker(axes, fit.baseline),
        '3_validity.png': lambda axes: _validity(axes, fit),
        '4_sands.png': lambda axes: _sands(axes, fit),
        '5_signal.png': lambda axes: _signal(axes, fit),
        '6_mass.png': lambda axes: _mass(axes, fit),
        '7_response.png': lambda axes: _response(axes, fit),
        '8_concentration.png': lambda axes: _concentration(axes, fit),
    }
    paths = []
    for name, draw in steps.items():
        figure = Figure(figsize=(9, 5.5), dpi=110, layout='constrained')
        draw(figure.subplots())
        paths.append(folder / name)
        figure.savefig(paths[-1])
    return paths


def _rectified(fit: CalibrationFit) -> NDArray[np.uint8]:
    """Return the baseline on the sampling grid, uint8 red-green-blue."""
    pixels = fit.baseline.sampling.sample(fit.baseline.decode(fit.baseline_photo).pixels)
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), np.uint8)


def _extent(baseline: Baseline) -> tuple[float, float, float, float]:
    """Return the edges of the rig [m] as matplotlib expects them."""
    return (0.0, baseline.grid.width, 0.0, baseline.grid.height)


def _label(axes: Any, title: str) -> None:
    axes.set_title(title)
    axes.set_xlabel('x [m]')
    axes.set_ylabel('z [m]')
    axes.set_aspect('equal')


def _geometry(axes: Any, fit: CalibrationFit) -> None:
    axes.imshow(_rectified(fit), extent=_extent(fit.baseline))
    axes.grid(color='white', linewidth=0.4, alpha=0.6)
    _label(axes, 'baseline in rig metres: edges of the sand must lie on the edges of the picture')


def _checker(axes: Any, baseline: Baseline) -> None:
    """Draw each patch in two halves: its published colour and the corrected photograph."""
    patches = baseline.chart.corrected_patches
    axes.axis('off')
    if patches is None:
        axes.set_title('no colour checker')
        return
    shown = np.ones((4 * 20, 6 * 20, 3))
    apart = np.linalg.norm(patches - REFERENCE, axis=1) / np.linalg.norm(REFERENCE, axis=1)
    for index in range(24):
        row, column = divmod(index, 6)
        left_half = (slice(20 * row, 20 * row + 16), slice(20 * column, 20 * column + 9))
        right_half = (slice(20 * row, 20 * row + 16), slice(20 * column + 9, 20 * column + 18))
        shown[left_half], shown[right_half] = REFERENCE[index], patches[index]
        words = f'{100 * apart[index]:.0f} %'
        axes.text(20 * column + 8.5, 20 * row + 16, words, ha='center', va='top', fontsize=8)
    axes.imshow(np.clip(shown, 0, 1) ** (1 / 2.2))
    axes.set_title(
        'colour checker: in each patch, left the published colour, right the photograph\n'
        f'after matching; below, their difference ({100 * float(np.median(apart)):.0f} % in the '
        'median).\nLarge everywhere: correct camera.colour_checker_px, dark skin first',
        fontsize=10,
    )


_HIDDEN = {
    'unlit': ('dark: frame or deep shadow', 'blue'),
    'checker': ('colour checker', 'magenta'),
    'water': ('smooth: water without grains', 'cyan'),
    'objects': ('objects: tubes, bolts', 'red'),
    'by hand': ('hidden.png', 'yellow'),
}
"""Words and colour of each part without visible sand."""


def _validity(axes: Any, fit: CalibrationFit) -> None:
    """Draw the parts without visible sand, with their share of the rig."""
    picture = _rectified(fit).astype(float) / 255
    mask = fit.baseline.mask
    parts = {name: getattr(mask, name) for name in list(_HIDDEN)[:-1]}
    parts['by hand'] = mask.usable & (fit.baseline.usable == 0)
    for name, hidden in parts.items():
        words, colour = _HIDDEN[name]
        picture[hidden] = 0.4 * picture[hidden] + 0.6 * np.array(mpl.colors.to_rgb(colour))
        if hidden.any():
            label = f'{words}, {100 * hidden.mean():.1f} %'
            axes.plot([], [], 's', color=colour, markeredgecolor='black', label=label)
    axes.imshow(picture, extent=_extent(fit.baseline))
    if axes.get_legend_handles_labels()[0]:
        axes.figure.legend(loc='outside lower center', ncols=3, frameon=False)
        masked = 'coloured parts are left out: no sand is visible there'
    else:
        masked = 'nothing is left out'
    _label(axes, f'{masked}; to leave out more, paint it white in hidden.png')


def _sands(axes: Any, fit: CalibrationFit) -> None:
    """Draw the sands, with the factor on the signal of each and its evidence."""
    axes.imshow(fit.sands[::-1], extent=_extent(fit.baseline), cmap='tab10', vmin=0, vmax=9)
    for label, factor in enumerate(fit.calibration.factors):
        one = fit.evidence.sands[label]
        words = (
            f'{one.label(label)}: x {factor:.2f} +- {factor * one.deviation:.2f}, '
            f'{SOURCES[one.source]}'
        )
        axes.plot([], [], 's', color=mpl.colormaps['tab10'](label), label=words)
    axes.figure.legend(
        loc='outside lower center',
        ncols=1,
        frameon=False,
        fontsize=9,
        title='sand: factor on its signal, relative to the sand that is known best',
    )
    _label(axes, 'sands; correct them in sands.png')


def _map(axes: Any, baseline: Baseline, values: Array, title: str, scale: str) -> None:
    """Draw a map; `scale` names its values."""
    image = axes.imshow(values, origin='lower', extent=_extent(baseline), cmap='viridis', vmin=0)
    axes.figure.colorbar(image, ax=axes, shrink=0.7, label=scale)
    _label(axes, f'{title}; white: left out')


def _signal(axes: Any, fit: CalibrationFit) -> None:
    """Draw the signal of the last photograph."""
    kind = {
        'absorbance': 'absorbance, -ln(light / baseline)',
        'difference': 'darkening, 1 - light / baseline',
    }[fit.calibration.signal.contrast]
    scale = f'{kind}, times the factor of the sand [-]'
    title = f'signal of the last photograph (stock {fit.stock_signal:.2f}): no jumps between sands'
    _map(axes, fit.baseline, fit.signals[-1], title, scale)


def _concentration(axes: Any, fit: CalibrationFit) -> None:
    """Draw the concentration of the last photograph, before denoising."""
    values = np.clip(fit.calibration.response.concentration_of(fit.signals[-1]), 0, 1)
    scale = 'concentration: 0 water, 1 tracer stock'
    _map(axes, fit.baseline, values, 'last photograph, before denoising', scale)


def _mass(axes: Any, fit: CalibrationFit) -> None:
    """Draw the imaged volume of tracer over the injected one, or over time without a pump log."""
    photographs, evidence = fit.evidence.photographs, fit.evidence
    imaged = 1e6 * np.array([one.imaged for one in photographs])
    agree = np.array([not one.disagreement for one in photographs])
    logged = np.isfinite(evidence.mass_factor)
    where = np.array([1e6 * one.injected if logged else one.time for one in photographs])
    axes.plot(where[agree], imaged[agree], 'o', label='a photograph')
    if not agree.all():
        axes.plot(where[~agree], imaged[~agree], 'x', color='red', label='one that disagrees')
    for x, y in zip(where, imaged, strict=True):
        axes.annotate(f'{y:.0f} ml', (x, y), (4, -12), textcoords='offset points', fontsize=8)
    axes.margins(x=0.08)
    axes.set_ylabel('tracer in the map [ml]')
    if not logged:
        axes.set_xlabel('time [s]')
        axes.set_title('tracer in the maps; there is no pump log to compare with')
        return
    ends = np.array([0.0, where.max()])
    offset = 1e6 * evidence.mass_offset * max(one.injected for one in photographs)
    axes.plot(ends, ends, 'k-', linewidth=0.8, label='equality')
    axes.plot(
        ends, evidence.mass_factor * ends + offset, '--', label='line through the photographs'
    )
    axes.set_xlabel('tracer injected after the pump log [ml]')
    axes.set_title(
        f'the maps hold {evidence.mass_factor:.3f} +- {evidence.mass_factor_deviation:.3f} times '
        f'the mass of the pump log,\nand {100 * evidence.mass_offset:+.1f} % of it before the '
        'injection began'
    )
    axes.legend()


_ANCHORED: dict[Anchor, str] = {
    'dilutions': 'from known dilutions',
    'core': 'from the core of the plume',
    'mass': 'from the mass of the pump log',
    'strongest signal': 'the strongest signal',
}
"""Words for the evidence of the level of stock."""


def _response(axes: Any, fit: CalibrationFit) -> None:
    """Draw the response with its deviation, the dilutions, and the signals inside the plumes."""
    response, level = fit.calibration.response, fit.stock_signal
    signal, values = np.array(response.signal) / level, np.array(response.concentration)
    spread = np.array(response.deviation)
    axes.fill_between(signal, values - spread, values + spread, alpha=0.3, label='its deviation')
    axes.plot(signal, values, label='response')
    axes.plot([0, 1], [0, 1], 'k--', linewidth=0.8, label='straight line')
    for number, one in enumerate(fit.dilutions):
        label = 'known dilutions' if number == 0 else None
        axes.plot(one.signal, one.concentration, 'o', color='red', label=label)
    depths = np.concatenate([depth.ravel() for depth in fit.depths])
    inside = np.concatenate([plane.ravel() for plane in fit.signals]) / level
    seen = inside[(depths > 0) & np.isfinite(inside)]
    counts, edges = np.histogram(seen, bins=np.linspace(0, 1.4, 71))
    axes.stairs(
        0.5 * counts / max(1, counts.max()),
        edges,
        color='grey',
        label='cells of the plumes',
    )
    axes.axvline(1.0, color='grey', linewidth=0.8, linestyle=':')
    axes.set_xlabel(f'signal relative to stock, {level:.3f} ({_ANCHORED[fit.evidence.anchor]})')
    axes.set_ylabel('concentration: 0 water, 1 tracer stock')
    axes.set_title('from signal to concentration; most cells of the plumes must lie at stock, 1')
    axes.legend(loc='upper left')
    axes.grid(linewidth=0.3)
