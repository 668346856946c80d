"""The score of calibrations and maps on photographs with known truth.

    python -m lab.photographs.photo_scores FOLDER [FOLDER ...]

Each FOLDER is a recording with `truth.nc`; its calibration is the folder `FOLDER_cal` beside it.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from lab.photographs.known_injection import fit_of_injection
from porotwin_core.basis.errors import InputError
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.calibrating.sand_refinement import refined
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.tracer.calibration import Calibration
from porotwin_recording.experiment.experiment_folder import folder_data
from porotwin_recording.tables.concentration import open_maps

Array = NDArray[Any]

MOST_MEDIAN, MOST_WORST, MOST_BIAS = 0.04, 0.06, 0.03
"""Accepted relative L2 error of the maps, in the median and in the worst frame, and bias [-]."""
ZONES = {'pale': (0.05, 0.2), 'low': (0.2, 0.5), 'high': (0.5, 0.8), 'stock': (0.9, 1.01)}
"""Ranges of the true concentration [-] by name; the bias is told for each."""
FEWEST_CELLS = 200
"""Cells of a zone, over all frames, below which it has no bias."""


@dataclass(frozen=True)
class MapScore:
    """Maps compared with their truth.

    Attributes:
        errors: relative L2 error of each frame with tracer, over its seen cells [-].
        bias: mean difference from the truth by zone [-]; NaN where a zone has too few cells.
    """

    errors: tuple[float, ...]
    bias: dict[str, float]

    @property
    def median(self) -> float:
        """Median of the errors [-]."""
        return float(np.median(self.errors))

    @property
    def worst(self) -> float:
        """Largest error [-]."""
        return max(self.errors)

    @property
    def accurate(self) -> bool:
        """Whether errors and bias are accepted."""
        biased = [zone for zone, value in self.bias.items() if abs(value) > MOST_BIAS]
        return self.median <= MOST_MEDIAN and self.worst <= MOST_WORST and not biased


@dataclass(frozen=True)
class PhotoCaseScore:
    """The answer to a case.

    Attributes:
        name: name of the case.
        flaw: what is wrong.
        expected: 'use', 'refuse' or 'either'.
        refusal: why the calibration was refused; empty if it was used.
        maps: score of the maps; None for a refused calibration.
        lines: the words of the calibration.
    """

    name: str
    flaw: str
    expected: str
    refusal: str
    maps: MapScore | None
    lines: tuple[str, ...] = ()

    @property
    def safe(self) -> bool:
        """Whether nobody gets a wrong map: the maps are accurate, or the calibration is refused."""
        return self.maps is None or self.maps.accurate

    @property
    def row(self) -> dict[str, object]:
        """The score as a row of a table; errors and bias in percent."""
        found = {'case': self.name, 'flaw': self.flaw, 'expected': self.expected}
        if self.maps is None:
            empty = dict.fromkeys(('median', 'worst', *ZONES), '')
            return {**found, 'answer': 'refused', 'safe': True, **empty}
        figures = {'median': self.maps.median, 'worst': self.maps.worst, **self.maps.bias}
        percent = {name: round(100 * value, 1) for name, value in figures.items()}
        return {**found, 'answer': 'used', 'safe': self.safe, **percent}


def compared(maps: Sequence[Array], truth: Sequence[Array]) -> MapScore:
    """Return the score of `maps` against `truth`, each (nz, nx) by frame; NaN is not seen."""
    errors = []
    for seen, true in zip(maps, truth, strict=True):
        known = np.isfinite(seen)
        norm = float(np.linalg.norm(true[known]))
        if norm > 0:
            errors.append(float(np.linalg.norm((seen - true)[known])) / norm)
    apart, true = np.stack(maps) - np.stack(truth), np.stack(truth)
    bias = {}
    for name, (low, high) in ZONES.items():
        zone = (true >= low) & (true < high) & np.isfinite(apart)
        bias[name] = float(apart[zone].mean()) if zone.sum() >= FEWEST_CELLS else np.nan
    return MapScore(tuple(errors), bias)


def score_case(folder: Path) -> PhotoCaseScore:
    """Return the score of the recording in `folder` with the calibration in `folder`_cal.

    Raises:
        InputError: a folder or its truth cannot be read.
    """
    told = yaml.safe_load((folder / 'truth.yaml').read_text(encoding='utf-8'))
    flaw, expected = told.get('flaw', 'unknown'), told.get('expected', 'either')
    try:
        fit = fit_of_injection(folder.with_name(f'{folder.name}_cal'))
    except InputError as refusal:
        return PhotoCaseScore(folder.name, flaw, expected, str(refusal), None)
    maps = imaged(folder, fit.calibration)
    return PhotoCaseScore(folder.name, flaw, expected, '', maps, tuple(fit.lines))


def imaged(folder: Path, calibration: Calibration) -> MapScore:
    """Return the score of the maps of the recording in `folder`.

    Raises:
        InputError: a photograph is refused.
    """
    data = folder_data(folder)
    truth = open_maps(folder / 'truth.nc', data.rig)
    baselines = [photo.read() for photo in data.photos if photo.role == 'baseline']
    states = [(photo.time, photo.read) for photo in data.photos if photo.role == 'state']
    schedule = data.measured or data.commanded
    used = refined(calibration, data.rig, baselines, states, schedule).calibration
    baseline = make_baseline(data.rig, truth.grid, baselines, calibration=used)
    maps, true = [], []
    for time, values in zip(truth.times, truth, strict=True):
        photo = min(data.photos, key=lambda one: abs(one.time - time))
        if photo.role == 'state':
            maps.append(concentration_map(photo.read(), baseline).values)
            true.append(values)
    return compared(maps, true)


def main() -> None:
    """Score the recordings that the command line names."""
    for name in sys.argv[1:]:
        score = score_case(Path(name))
        for line in score.lines:
            print('   ', line)
        print(*(f'{key} {value}' for key, value in score.row.items()), score.refusal, sep=', ')


if __name__ == '__main__':
    main()
