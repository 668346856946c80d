"""Photographs of CO2 in the large FluidFlower rig against the official map, and composed ones.

    python -m lab.photographs.co2_against_map [--data ../shared/data/fluidflower_co2]

Writes docs/figures/segmentation.csv and docs/figures/segmentation.png. The official map is the
answer of an early version of another program, not truth. The photographs are those of
github.com/pmgbergen/DarSIA, the map that of github.com/fluidflower/experiment; the README of the
data folder tells which. On the composed photographs the truth is known (`co2_sand.py`).
"""

import argparse
import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import cv2
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from lab.photographs.co2_sand import INDICATORS, Co2Sand, Fluids, drawn_fluids, drawn_shot
from lab.photographs.dyed_sand import Shot
from porotwin_cli.pictures.phase_picture import COLOURS
from porotwin_cli.workspace import ROOT
from porotwin_core.geometry.grid import Grid, conservative_resample
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.geometry.alignment import align
from porotwin_imaging.phases.colour_change import Box
from porotwin_imaging.phases.phase_colours import DISSOLVED, GAS, PHASES, UNKNOWN, WATER
from porotwin_imaging.phases.phase_segmentation import PhaseMap
from porotwin_imaging.phases.phase_series import series_match
from porotwin_imaging.phases.phase_study import PhaseStudy
from porotwin_recording.tables.phase_csv import read_phase_csv

Pixels = NDArray[np.uint8]
Boxes = Mapping[int, Sequence[Box]]

DATA = ROOT.parent / 'shared' / 'data' / 'fluidflower_co2'
FIGURES = ROOT / 'docs' / 'figures'
BOXES: Boxes = {GAS: [Box(1.3, 0.4, 1.9, 0.46)], DISSOLVED: [Box(1.62, 0.75, 1.72, 0.9)]}
"""A box of gas and one of dissolved CO2, as a person would draw them on the photograph."""
STAINED = Box(1.5, 1.03, 2.4, 1.08)
"""The thin upper band, which is red in the photograph and water in the official map."""
SIZES = {'large': 0.8, 'small': 0.3}
"""Sizes of the composed plumes."""
SERIES_S = np.geomspace(900.0, 10800.0, 40)
"""Times of the maps of a composed series; plumes grow with the square root of time."""
DATED = (10, 20, 28, 36)
"""Photographs are taken half-way from these maps to the next ones."""
PEERS = {'as true': 0.5, 'larger plumes': 0.25, 'smaller plumes': 0.75}
"""Share of the colour above which the maps of the series have a phase."""


@dataclass(frozen=True)
class Co2Photographs:
    """The baseline, a photograph with CO2, and the official map of it.

    Attributes:
        rig: the rig with its camera.
        baseline: file of the photograph without CO2.
        state: file of the photograph with CO2.
        official: phases of the official map, shape (nz, nx), row 0 at the bottom.
    """

    rig: Rig
    baseline: bytes
    state: bytes
    official: NDArray[np.uint8]

    @classmethod
    def read(cls, folder: Path) -> 'Co2Photographs':
        """Return the photographs in `folder`, laid out as the shared data are."""
        (table,) = folder.glob('*_segmentation_*.csv')
        return cls(
            rig_of(json.loads((folder / 'config_co2.json').read_text())),
            (folder / 'co2_0.jpg').read_bytes(),
            (folder / 'co2_1.jpg').read_bytes(),
            read_phase_csv(table, len(PHASES)),
        )

    @property
    def grid(self) -> Grid:
        """The grid of the official map."""
        nz, nx = self.official.shape
        return self.rig.grid(nx, nz)

    def phases(self, boxes: Boxes | None = None, state: bytes | None = None) -> PhaseMap:
        """Return the phases of `state`, or of the photograph itself."""
        return _phases(self.rig, self.grid, self.baseline, state or self.state, boxes or {})


def rig_of(config: Mapping[str, Any], scale: float = 1.0) -> Rig:
    """Return the large rig with the camera of a configuration; `scale` is that of the pixels."""
    curvature = config['curvature']
    bulge, stretch = curvature['bulge'], curvature['stretch']
    camera: dict[str, Any] = {
        'corners_px': (np.array(curvature['crop']['pts_src']) * scale).tolist(),
        'colour_checker_px': (np.array(config['color']['roi']) * scale).tolist(),
        'curvature': {
            'vertical_bulge': bulge['vertical_bulge'] / scale**2,
            'vertical_bulge_offset': bulge['vertical_center_offset'] * scale,
            'horizontal_stretch': stretch['horizontal_stretch'] / scale**2,
            'horizontal_stretch_offset': stretch['horizontal_center_offset'] * scale,
            'vertical_stretch': stretch['vertical_stretch'] / scale**2,
            'vertical_stretch_offset': stretch['vertical_center_offset'] * scale,
        },
    }
    size = config['physical_asset']['dimensions']
    return Rig.model_validate(
        {
            'name': 'large-fluidflower',
            'width_m': size['width'],
            'height_m': size['height'],
            'depth_m': 0.0235,
            'porosity': 0.44,
            'permeability_m2': 1e-9,
            'viscosity_pa_s': 1e-3,
            'density_kg_m3': 998.0,
            'boundaries': {'top': 'open'},
            'wells': {'upper': {'x_m': 1.7, 'z_m': 0.7}, 'lower': {'x_m': 0.9, 'z_m': 0.3}},
            'camera': camera,
        }
    )


def _phases(rig: Rig, grid: Grid, baseline: bytes, state: bytes, boxes: Boxes) -> PhaseMap:
    """Return the phases in a photograph."""
    reference = make_baseline(rig, grid, [baseline])
    return PhaseStudy.of({0.0: lambda: state}, reference, boxes).phases(state)


def overlaps(found: NDArray[np.uint8], truth: NDArray[np.uint8]) -> dict[str, float]:
    """Return intersections over unions over all cells; one without a phase counts as no CO2."""
    co2 = {'CO2': (DISSOLVED, GAS), 'gas': (GAS,), 'dissolved': (DISSOLVED,)}
    both = {name: (np.isin(found, of), np.isin(truth, of)) for name, of in co2.items()}
    return {name: float((a & b).sum() / max(1, (a | b).sum())) for name, (a, b) in both.items()}


def _decoded(data: bytes, how: int) -> Pixels:
    """Return the pixels of a photograph, blue-green-red."""
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), how), np.uint8)


def _encoded(pixels: NDArray[Any]) -> bytes:
    """Return a photograph as a JPEG file."""
    whole = np.clip(np.rint(pixels), 0, 255).astype(np.uint8)
    return bytes(cv2.imencode('.jpg', whole, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes())


def _disturbed(state: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield the photograph as another day would show it, by name. 2.2: the exponent of light."""
    pixels = _decoded(state, cv2.IMREAD_COLOR).astype(np.float32)
    rows, columns = pixels.shape[:2]
    for percent in (-10, 10):
        yield f'exposure {percent:+d} %', _encoded(pixels * (1 + percent / 100) ** (1 / 2.2))
    warm = np.array([0.92, 1.0, 1.08]) ** (1 / 2.2)
    yield 'warmer by 8 %', _encoded(pixels * warm)
    noise = np.random.default_rng(1).normal(0.0, 6.0, pixels.shape)
    yield 'noise of 6 grey levels', _encoded(pixels + noise)
    moved = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 2.0]], np.float32)
    yield 'shift by 2 px', _encoded(cv2.warpAffine(pixels, moved, (columns, rows)))
    yield 'blur of 2 px', _encoded(cv2.GaussianBlur(pixels, (0, 0), 2.0))


def _composed(seed: int) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the overlaps of composed photographs by name; the sand has two kinds of grains."""
    from lab.test.photo_examples import small_rig, textured_baseline

    rig, sand = small_rig(), textured_baseline()
    nothing = Fluids(np.zeros((2, 2)), np.zeros((2, 2)))
    for size, growth in SIZES.items():
        for indicator in INDICATORS:
            generator = np.random.default_rng(seed)
            scene = Co2Sand(rig, sand, INDICATORS[indicator])
            fluids = drawn_fluids(rig, generator, growth)
            first = scene.photograph(nothing, Shot(), seed=1)
            last = scene.photograph(fluids, drawn_shot(generator), seed=2)
            grid = rig.default_grid()
            found = _phases(rig, grid, first, last, {}).phase
            fields = (fluids.indicator, fluids.gas)
            truth = Fluids(*(conservative_resample(part, grid.shape) for part in fields)).phases
            yield size, overlaps(found, truth)


def _dated(seed: int) -> Iterator[tuple[str, float]]:
    """Yield the errors of the times of composed photographs within series, by the series' maker.

    No map of a series has the time of a photograph.
    """
    from lab.test.photo_examples import small_rig, textured_baseline

    rig, sand = small_rig(), textured_baseline()
    grid = rig.default_grid(0.01)

    def grown(time: float) -> Fluids:
        growth = float(time / SERIES_S[-1]) ** 0.5
        return drawn_fluids(rig, np.random.default_rng(seed), growth)

    fluids = {float(time): grown(time) for time in SERIES_S}
    series = {
        peer: {time: _judged(one, least, grid) for time, one in fluids.items()}
        for peer, least in PEERS.items()
    }
    shot = drawn_shot(np.random.default_rng(seed))
    for indicator in INDICATORS.values():
        scene = Co2Sand(rig, sand, indicator)
        first = scene.photograph(Fluids(np.zeros((2, 2)), np.zeros((2, 2))), Shot(), seed=1)
        for time in (float(SERIES_S[at : at + 2].mean()) for at in DATED):
            last = scene.photograph(grown(time), shot, seed=2)
            found = _phases(rig, grid, first, last, {}).phase
            for peer, maps in series.items():
                yield peer, series_match(found, maps).time_s / time - 1.0


def _judged(fluids: Fluids, least: float, grid: Grid) -> NDArray[np.uint8]:
    """Return the map of somebody to whom a phase begins at the share `least` of its colour."""
    fields = (fluids.indicator, fluids.gas)
    indicator, gas = (conservative_resample(part, grid.shape) for part in fields)
    return Fluids(indicator + 0.5 - least, gas + 0.5 - least).phases


def _lines(case: Co2Photographs) -> Iterator[tuple[str, str, float]]:
    """Yield all figures: subject, figure and value."""
    with_stain = {**BOXES, WATER: [STAINED]}
    for name, boxes in (
        ('without boxes', {}),
        ('with boxes of gas and dissolved CO2', BOXES),
        ('with these and one of water', with_stain),
    ):
        found = case.phases(boxes)
        for phase, overlap in overlaps(found.phase, case.official).items():
            yield f'overlap with the official map, all cells, {name}', phase, overlap
        if boxes:
            continue
        seen = np.isin(found.phase, (DISSOLVED, GAS))
        official = case.official != WATER
        yield 'cells of CO2', 'official', float(official.sum())
        yield 'cells of CO2', 'ours alone', float((seen & ~official).sum())
        yield 'cells of CO2', 'official alone', float((official & ~seen).sum())
        unknown = (found.phase == UNKNOWN) & (case.official != WATER)
        yield 'official CO2 cells without a phase', 'share', float(unknown.mean())
        agrees = found.phase == case.official
        for low, high in ((0.0, 0.9), (0.9, 0.99), (0.99, 1.1)):
            inside = (found.confidence >= low) & (found.confidence < high) & (found.phase != WATER)
            yield (
                'CO2 cells that agree with the official map',
                f'confidence from {low:g} to {min(high, 1.0):g}',
                float(agrees[inside].mean()),
            )
    for name, state in _disturbed(case.state):
        for phase, overlap in overlaps(case.phases(state=state).phase, case.official).items():
            if phase != 'dissolved':
                yield f'overlap with the official map, {name}', phase, overlap
    yield from _date_lines()
    composed = list(_composed(seed=3))
    for size in SIZES:
        for phase in ('CO2', 'gas', 'dissolved'):
            worst = min(one[phase] for name, one in composed if name == size)
            yield f'overlap on four composed photographs, {size} plumes: {phase}', 'worst', worst


def _date_lines() -> Iterator[tuple[str, str, float]]:
    """Yield the median and the largest error of the times of composed photographs."""
    dated = [one for seed in (3, 4) for one in _dated(seed)]
    for peer in PEERS:
        errors = [abs(error) for name, error in dated if name == peer]
        what = f'time of {len(errors)} composed photographs within a series of maps, {peer}'
        yield what, 'median error', float(np.median(errors))
        yield what, 'largest error', max(errors)


def _picture(case: Co2Photographs, target: Path) -> None:
    """Draw the photograph, the map and the official map below each other."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    reference = make_baseline(case.rig, case.grid, [case.baseline])
    pixels = reference.decode(case.state).pixels
    moved = reference.sampling.sample(pixels, align(pixels, reference.features).homography)
    bright = np.clip(moved[..., ::-1].astype(float) * 1.8, 0, 255).astype(np.uint8)
    found = case.phases()
    extent = (0.0, case.rig.width_m, 0.0, case.rig.height_m)
    figure, axes = plt.subplots(3, 1, figsize=(6, 10), layout='constrained')
    axes[0].imshow(bright, extent=extent)
    palette, steps = ListedColormap(list(COLOURS)), BoundaryNorm(np.arange(4) - 0.5, len(PHASES))
    for axis, phases in ((axes[1], found.phase), (axes[2], case.official)):
        shown = np.ma.masked_equal(phases, UNKNOWN)
        axis.imshow(shown, origin='lower', extent=extent, cmap=palette, norm=steps)
    keys = [Patch(color=colour, label=name) for colour, name in zip(COLOURS, PHASES, strict=True)]
    axes[1].legend(handles=keys, loc='upper right', fontsize='small')
    titles = ('photograph, registered and brightened', 'segment, without boxes', 'official map')
    for axis, title in zip(axes, titles, strict=True):
        axis.set_title(title)
        axis.set_ylabel('z [m]')
    axes[-1].set_xlabel('x [m]')
    figure.savefig(target, dpi=80)
    plt.close(figure)


def main() -> None:
    """Measure, and write the table and the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--data', type=Path, default=DATA)
    parser.add_argument('--figures', type=Path, default=FIGURES)
    options = parser.parse_args()
    case = Co2Photographs.read(options.data)
    with (options.figures / 'segmentation.csv').open('w', encoding='utf-8', newline='') as file:
        table = csv.writer(file, lineterminator='\n')
        names = ('date', 'command', 'seed', 'cases', 'what', 'figure', 'value', 'wanted', 'page')
        table.writerow(names)
        for what, figure, value in _lines(case):
            print(f'{what}: {figure}: {value:.3f}', flush=True)
            command = 'lab/photographs/co2_against_map.py'
            line = (date.today(), command, '', '', what, figure, f'{value:.3f}', '', '')
            table.writerow(line)
    _picture(case, options.figures / 'segmentation.png')


if __name__ == '__main__':
    main()
