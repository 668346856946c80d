"""Pictures to judge each step of a calibration by."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from porotwin_imaging import photograph
from porotwin_imaging.chain import Imaging
from porotwin_imaging.colour_checker import REFERENCE

if TYPE_CHECKING:
    from porotwin_imaging.calibrate import Calibrated

Array = NDArray[Any]


def draw(
    output: Path,
    imaging: Imaging,
    baseline: bytes,
    labels: NDArray[np.uint8],
    signals: list[Array],
    result: 'Calibrated',
) -> list[Path]:
    """Write the pictures of all steps into `output` and return their paths."""
    steps = {
        '1_geometry.png': lambda axes: _geometry(axes, imaging, baseline),
        '2_colour_checker.png': lambda axes: _checker(axes, imaging),
        '3_validity.png': lambda axes: _validity(axes, imaging, baseline),
        '4_sands.png': lambda axes: _sands(axes, imaging, labels, result),
        '5_signal.png': lambda axes: _map(axes, imaging, signals[-1], 'signal, last photograph'),
        '6_mass.png': lambda axes: _mass(axes, result),
        '7_response.png': lambda axes: _response(axes, result),
        '8_concentration.png': lambda axes: _map(
            axes,
            imaging,
            np.clip(result.calibration.response.concentration_of(signals[-1]), 0, 1),
            'concentration, last photograph',
        ),
    }
    paths = []
    for name, step in steps.items():
        figure = Figure(figsize=(9, 5.5), dpi=110, layout='constrained')
        step(figure.subplots())
        paths.append(output / name)
        figure.savefig(paths[-1])
    return paths


def _rectified(imaging: Imaging, baseline: bytes) -> NDArray[np.uint8]:
    picture = photograph.decode(baseline, imaging.reduction)
    pixels = imaging.sampling.sample(picture.pixels)
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), np.uint8)


def _extent(imaging: Imaging) -> tuple[float, float, float, float]:
    return (0.0, imaging.grid.width, 0.0, imaging.grid.height)


def _label(axes: Any, title: str) -> None:
    axes.set_title(title)
    axes.set_xlabel('x [m]')
    axes.set_ylabel('z [m]')
    axes.set_aspect('equal')


def _geometry(axes: Any, imaging: Imaging, baseline: bytes) -> None:
    axes.imshow(_rectified(imaging, baseline), extent=_extent(imaging))
    axes.grid(color='white', linewidth=0.4, alpha=0.6)
    _label(axes, 'baseline in rig metres: edges of the sand must lie on the edges of the picture')


def _checker(axes: Any, imaging: Imaging) -> None:
    patches = imaging.matched_patches
    if patches is None:
        axes.set_title('no colour checker')
        axes.axis('off')
        return
    shown = np.zeros((4 * 20, 6 * 20, 3))
    for index in range(24):
        row, column = divmod(index, 6)
        area = (slice(20 * row, 20 * row + 18), slice(20 * column, 20 * column + 9))
        other = (slice(20 * row, 20 * row + 18), slice(20 * column + 9, 20 * column + 18))
        shown[area], shown[other] = REFERENCE[index], patches[index]
    axes.imshow(np.clip(shown, 0, 1) ** (1 / 2.2))
    axes.set_title('colour checker: reference left, photograph after matching right in each patch')
    axes.axis('off')


def _validity(axes: Any, imaging: Imaging, baseline: bytes) -> None:
    picture = _rectified(imaging, baseline).astype(float) / 255
    found = imaging.validity
    assert found is not None
    colours = {'unlit': 'blue', 'checker': 'magenta', 'water': 'cyan', 'objects': 'red'}
    for name, colour in colours.items():
        mask = getattr(found, name)
        picture[mask] = 0.4 * picture[mask] + 0.6 * np.array(mpl.colors.to_rgb(colour))
        axes.plot([], [], 's', color=colour, label=name)
    axes.imshow(picture, extent=_extent(imaging))
    axes.legend(loc='lower right')
    _label(axes, 'where nothing can be read off; correct by hand with hidden.png')


def _sands(axes: Any, imaging: Imaging, labels: NDArray[np.uint8], result: 'Calibrated') -> None:
    axes.imshow(labels[::-1], extent=_extent(imaging), cmap='tab10', vmin=0, vmax=9)
    for label, factor in enumerate(result.calibration.factors):
        axes.plot([], [], 's', color=mpl.colormaps['tab10'](label), label=f'x {factor:.2f}')
    axes.legend(loc='lower right', title='factor')
    _label(axes, 'sands; correct by hand with sands.png')


def _map(axes: Any, imaging: Imaging, values: Array, title: str) -> None:
    image = axes.imshow(values, origin='lower', extent=_extent(imaging), cmap='viridis', vmin=0)
    axes.figure.colorbar(image, ax=axes, shrink=0.7)
    _label(axes, title)


def _mass(axes: Any, result: 'Calibrated') -> None:
    if result.growth is None:
        axes.set_title('no pump log')
        axes.axis('off')
        return
    injected, seen = 1e6 * np.array(result.injected), 1e6 * np.array(result.seen)
    inliers = result.growth.inliers
    axes.plot(injected[inliers], seen[inliers], 'o', label='used')
    axes.plot(injected[~inliers], seen[~inliers], 'x', color='red', label='outliers')
    axes.plot([0, injected.max()], [0, injected.max()], 'k-', linewidth=0.8, label='equal')
    axes.set_xlabel('tracer injected after the pump log [ml]')
    axes.set_ylabel('tracer seen [ml]')
    axes.set_title('mass growth')
    axes.legend()


def _response(axes: Any, result: 'Calibrated') -> None:
    response = result.calibration.response
    axes.plot(response.signal, response.concentration, 'o-')
    axes.set_xlabel('signal')
    axes.set_ylabel('concentration [-]')
    axes.set_title('response')
    axes.grid(linewidth=0.3)
