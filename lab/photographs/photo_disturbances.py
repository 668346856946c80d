"""The imaging of disturbed photographs: the error of the map, or the words that refuse it.

    python -m lab.photographs.photo_disturbances RECORDING CALIBRATION [--time SECONDS]

RECORDING is an experiment folder with a baseline and photographs of tracer, CALIBRATION its
calibration.yaml. One photograph is disturbed in linear light and imaged again. The table gives the
relative L2 distance of its map from that of the undisturbed photograph and the change of its mass,
both over the cells that the two maps show, the share of the sand that is left out, and the remarks.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lab.photographs.co2_sand import INDICATORS, Co2Sand, Fluids, drawn_fluids
from lab.photographs.dyed_sand import TO_LINEAR, Linear, Shot
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import ConcentrationMap, concentration_map
from porotwin_imaging.tracer.calibration import Calibration, load_calibration
from porotwin_recording.experiment.experiment_folder import folder_data

GRID = (280, 150)
"""Columns and rows of the maps."""
_QUALITY = 92
"""JPEG quality of the disturbed photographs."""
_SOFT_SHARE = 0.04
"""Width of the soft edge of a shadow relative to the width of the photograph [-]."""
_TUBE = np.array([[0.2, 0.05], [0.25, 0.3], [0.4, 0.5], [0.45, 0.8]])
"""Course of a tube across and down the photograph, relative to its size [-]."""
_FINER = 4
"""Points across a pixel in which a tube is drawn."""
_DARK, _WHITE = (0.05, 0.05, 0.06), (0.6, 0.6, 0.6)
"""Linear light of tubes, blue, green, red [-]."""
_SCATTERED = 0.6
"""Linear light of haze [-]."""
_SEED = 5

Disturbance = Callable[[Linear], Linear]
"""Changes the linear light of a photograph, shape (rows, columns, 3 = blue, green, red)."""


def _shadow(depth: float, place: str) -> Disturbance:
    """Return a soft shadow on the 'right' third, a 'corner' (a quarter), or a 'spot' on a plume."""

    def change(light: Linear) -> Linear:
        rows, columns = light.shape[:2]
        row, column = np.mgrid[:rows, :columns].astype(np.float32)
        soft = _SOFT_SHARE * columns
        if place == 'spot':
            across, down = column / columns - 0.6, row / rows - 0.45
            shade = np.exp(-((across / 0.12) ** 2) - (down / 0.25) ** 2)
        elif place == 'corner':
            shade = _step(column - 0.5 * columns, soft) * _step(0.5 * rows - row, soft)
        else:
            shade = _step(column - 0.65 * columns, soft)
        return np.asarray(light * (1 - depth * shade)[..., None], np.float32)

    return change


def _step(distance: Linear, soft: float) -> Linear:
    """Return a smooth step from 0 to 1 at distance 0 [px]."""
    return np.asarray(1.0 / (1.0 + np.exp(-distance / soft)), np.float32)


def _tube(width_px: float, colour: tuple[float, float, float]) -> Disturbance:
    """Return a tube before the glass."""

    def change(light: Linear) -> Linear:
        rows, columns = light.shape[:2]
        drawn = np.zeros((rows * _FINER, columns * _FINER), np.uint8)
        places = (_TUBE * [columns * _FINER, rows * _FINER]).astype(np.int32)
        cv2.polylines(drawn, [places], False, 255, round(width_px * _FINER), cv2.LINE_AA)
        share = cv2.resize(drawn, (columns, rows), interpolation=cv2.INTER_AREA)[..., None] / 255.0
        return np.asarray(light * (1 - share) + share * np.array(colour), np.float32)

    return change


def _camera(
    across_px: float = 0.0, down_px: float = 0.0, degrees: float = 0.0, zoom: float = 1.0
) -> Disturbance:
    """Return a camera that was moved, turned or zoomed; what it did not see is black."""

    def change(light: Linear) -> Linear:
        rows, columns = light.shape[:2]
        move = cv2.getRotationMatrix2D((columns / 2, rows / 2), degrees, zoom)
        move[:, 2] += np.array([across_px, down_px])
        return np.asarray(cv2.warpAffine(light, move, (columns, rows), flags=cv2.INTER_CUBIC))

    return change


def _haze(share: float) -> Disturbance:
    """Return haze that replaces a share of the light."""
    return lambda light: (1 - share) * light + np.float32(share * _SCATTERED)


DISTURBANCES: Mapping[str, Disturbance] = {
    'none, encoded again': lambda light: light,
    'soft shadow of 25 % over a third': _shadow(0.25, 'right'),
    'soft shadow of 25 % over a quarter': _shadow(0.25, 'corner'),
    'soft shadow of 40 % over a quarter': _shadow(0.4, 'corner'),
    'soft shadow of 25 % on a plume': _shadow(0.25, 'spot'),
    'light times 0.4': lambda light: 0.4 * light,
    'light times 2, clipped': lambda light: 2.0 * light,
    'light times 3, clipped': lambda light: 3.0 * light,
    'gamma 0.9': lambda light: light**0.9,
    'gamma 1.1': lambda light: light**1.1,
    'haze, 2 % of the light': _haze(0.02),
    'haze, 5 % of the light': _haze(0.05),
    'dark tube, 4 px': _tube(4, _DARK),
    'dark cable, 2 px': _tube(2, _DARK),
    'white tube, 4 px': _tube(4, _WHITE),
    'camera moved by 10 px': _camera(8, 6),
    'camera moved by 60 px': _camera(60, 0),
    'camera moved by 80 px': _camera(64, 48),
    'camera turned by 2 degrees': _camera(degrees=2),
    'zoom of 5 %': _camera(zoom=1.05),
}
"""Disturbances by name."""


@dataclass(frozen=True)
class DisturbedMap:
    """The map of a disturbed photograph beside that of the undisturbed one.

    Attributes:
        name: what was disturbed.
        distance: relative L2 distance of the maps [-]; NaN for a refused photograph.
        mass: relative change of the mass [-]; NaN for a refused photograph.
        left_out: share of the sand that only the undisturbed map shows [-].
        words: the refusal, or the remarks.
    """

    name: str
    distance: float
    mass: float
    left_out: float
    words: str


def disturbed_maps(
    folder: Path, calibration: Path, time: float | None = None
) -> list[DisturbedMap]:
    """Return one row for each of `DISTURBANCES`, and for photographs of CO2.

    Args:
        folder: experiment folder with a baseline and photographs of tracer.
        calibration: calibration.yaml of its camera.
        time: time of the photograph that is disturbed [s]; None: the middle one.

    Raises:
        InputError: a file cannot be read, or the undisturbed photograph is refused.
    """
    data = folder_data(folder)
    baselines = [photo.read() for photo in data.photos if photo.role == 'baseline']
    states = [photo for photo in data.photos if photo.role == 'state']
    used = load_calibration(calibration)
    baseline = make_baseline(data.rig, data.rig.grid(*GRID), baselines, calibration=used)
    middle = states[len(states) // 2].time if time is None else time
    photo = min(states, key=lambda one: abs(one.time - middle)).read()
    reference = concentration_map(photo, baseline)
    volume = data.rig.cell_pore_volume(baseline.grid)
    light = TO_LINEAR[_pixels(photo)]
    files = {name: _file(change(light)) for name, change in DISTURBANCES.items()}
    rows = []
    for name, file in files.items():
        try:
            rows.append(_compared(name, concentration_map(file, baseline), reference, volume))
        except InputError as refusal:
            rows.append(DisturbedMap(name, np.nan, np.nan, np.nan, f'refused: {refusal}'))
    sand = _pixels(baselines[0])
    return [*rows, *(_co2(data.rig, sand, name, used) for name in INDICATORS)]


def _compared(
    name: str, found: ConcentrationMap, reference: ConcentrationMap, volume: NDArray[Any]
) -> DisturbedMap:
    """Return the row of a map."""
    known = np.isfinite(reference.values)
    both = known & np.isfinite(found.values)
    before, after = reference.values[both], found.values[both]
    mass = float((volume[both] * after).sum() / (volume[both] * before).sum()) - 1.0
    return DisturbedMap(
        name,
        float(np.linalg.norm(after - before) / np.linalg.norm(before)),
        mass,
        1.0 - float(both.sum() / known.sum()),
        '; '.join(found.status),
    )


def _co2(rig: Rig, sand: NDArray[np.uint8], name: str, used: Calibration) -> DisturbedMap:
    """Return the row of gas and dissolved CO2, imaged as if the pH indicator were the tracer.

    The baseline shows water with the indicator `name` of `INDICATORS`.
    """
    fluids = drawn_fluids(rig, np.random.default_rng(_SEED), growth=0.8)
    water = Fluids(np.zeros_like(fluids.gas), np.zeros_like(fluids.gas))
    composed = Co2Sand(rig, sand, INDICATORS[name])
    before, file = (composed.photograph(one, Shot(), seed=_SEED) for one in (water, fluids))
    words = f'CO2, indicator {name}'
    try:
        baseline = make_baseline(rig, rig.grid(*GRID), [before], calibration=used)
        found = concentration_map(file, baseline)
    except InputError as refusal:
        return DisturbedMap(words, np.nan, np.nan, np.nan, f'refused: {refusal}')
    seen = np.isfinite(found.values)
    tracer = f'{100 * found.values[seen].mean():.1f} % of the pores read as stock'
    return DisturbedMap(
        words, np.nan, np.nan, 1.0 - float(seen.mean()), '; '.join([tracer, *found.status])
    )


def _pixels(file: bytes) -> NDArray[np.uint8]:
    """Return the pixels of a photograph, blue, green, red."""
    return np.asarray(cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR), np.uint8)


def _file(light: Linear) -> bytes:
    """Return the JPEG file of linear light; brighter light than white is clipped."""
    levels = np.interp(np.clip(light, 0.0, 1.0), TO_LINEAR, np.arange(256.0))
    pixels = np.rint(levels).astype(np.uint8)
    _, data = cv2.imencode('.jpg', pixels, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return data.tobytes()


def main() -> None:
    """Print the table for the folder that the command line names."""
    parser = argparse.ArgumentParser(description='Image disturbed photographs.')
    parser.add_argument('folder', type=Path, help='experiment folder')
    parser.add_argument('calibration', type=Path, help='calibration.yaml of its camera')
    parser.add_argument('--time', type=float, help='time of the photograph [s]; default: middle')
    asked = parser.parse_args()
    for row in disturbed_maps(asked.folder, asked.calibration, asked.time):
        figures = [100 * value for value in (row.distance, row.mass, row.left_out)]
        distance, mass, left_out = figures
        print(
            f'{row.name}: {distance:.1f} %, mass {mass:+.1f} %, {left_out:.1f} % left out; ', end=''
        )
        print(row.words)


if __name__ == '__main__':
    main()
