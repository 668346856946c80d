"""The seepage tank of 1904, blind: the later photographs are predicted from the earlier ones.

    ./porotwin experiment seepage --photographs FOLDER

The photographs are grey prints of different crop, without a chart, and nobody noted what the tubes
delivered. Their maps have a relative scale. The first photographs and the prior of
`rigs/pennink_1904/rig.yaml` give the rate of each tube with an interval, as a diagnosis fits
unknown rates. The model starts from the map of the last one that it may use, and is compared with
the later ones by tips, centre lines and, once the ink has stopped, tails. It does so with the
photographs to 09:55, and with those to 10:55 if the folder holds later ones. The flow of 1.25 l/h
that Pennink measured gives the conductivity in `rig.yaml`; nothing is fitted to the later
photographs. `causes` tells which effects beside the rates would narrow the gap.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from lab.photographs.plume_lines import (
    FRONT,
    LineDistance,
    PlumeLine,
    line_error,
    line_of,
    open_water,
    plume_lines,
    without_holes,
)
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import MINUTE_S, from_ml_h
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig, Well, load_rig
from porotwin_diagnosis.data.noise import Noise
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, Sample
from porotwin_diagnosis.data.shared_errors import measured_errors, sands_of
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.library import library
from porotwin_diagnosis.model.unknown_rates import SourceRate, at_first_rates, sources_of
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.calibrating.relative_scale import relative_calibration
from porotwin_imaging.geometry.alignment import align
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_solver.model.simulation import simulate

Array = NDArray[Any]

ROOT = Path(__file__).resolve().parents[2]
RIG = ROOT / 'rigs' / 'pennink_1904'
PHOTOGRAPHS = ROOT.parent / 'shared' / 'data' / 'pennink_1904'
ORIGINALS = 'github.com/Olsthoorn/Pennink-Model, folder cases/Series2/Photos'
BASELINE = 'Series2_01_p30.jpg'
"""The photograph before the ink, of 09:00."""
TIMES_MIN = {
    'Series2_02_p32.jpg': 0.0,
    'Series2_03_p34.jpg': 15.0,
    'Series2_04_p36.jpg': 40.0,
    'Series2_05_p38.jpg': 75.0,
}
"""Photographs with ink, and minutes after 09:40, when the first ink had been brought in."""
LATER_MIN = {'Series2_06_p40.jpg': 105.0, 'Series2_07_p42.jpg': 220.0, 'Series2_08_p44.jpg': 285.0}
"""Later ones, which a prediction may be compared with if they are there, but never use."""
STOPPED_S = 220.0 * MINUTE_S
"""When the ink was stopped."""
SEEN = (2, 4)
"""Photographs that the predictions may use: those to 09:55, and to 10:55."""
CAUSES = ('dispersion', 'buoyancy', 'viscosity', 'fringe', 'permeability', 'heterogeneity')
"""Effects that may act beside the rates of the tubes."""
CAUSE_CELL_M = 0.015
"""Cells of the maps for their fits [m]."""


@dataclass(frozen=True)
class SeenPhoto:
    """A photograph of the experiment.

    Attributes:
        time: since the ink was brought in [s].
        name: its file.
        picture: grey levels in the place of the rig, row 0 at the top.
        values: its relative map, shape (nz, nx).
        plumes: its plumes by well.
        status: remarks.
        deviation, systematic: standard deviation of the map, and the part that all maps share.
    """

    time: float
    name: str
    picture: Array
    values: Array
    plumes: dict[str, PlumeLine]
    status: list[str]
    deviation: Array
    systematic: Array


@dataclass(frozen=True)
class PlumePrediction:
    """Plumes that were predicted for one photograph, with their errors by well."""

    seen: SeenPhoto
    plumes: dict[str, PlumeLine]
    errors: dict[str, LineDistance]


def run(photographs: Path, folder: Path) -> list[dict[str, Any]]:
    """Predict the later photographs; write a picture; return a row for every plume and time.

    Args:
        photographs: their folder.
        folder: where the picture goes.

    Raises:
        InputError: a photograph is missing or cannot be used.
    """
    rig = load_rig(RIG)
    grid = rig.default_grid()
    seen = map_photographs(rig, grid, photographs)
    rows = []
    for count in SEEN:
        if count < len(seen):
            fitted = fitted_rates(rig, grid, seen[:count])
            rates = {name: rate.rate_ml_h for name, rate in fitted.items()}
            predictions = predict(rig, grid, seen[:count], seen[count:], rates)
            draw(folder / f'seepage_{count}.png', rig, grid, seen, predictions)
            rows += _rows(seen[count - 1].name, fitted, predictions)
    return rows


def _rows(
    last: str, fitted: Mapping[str, SourceRate], predictions: Sequence['PlumePrediction']
) -> list[dict[str, Any]]:
    """Return a row for every plume and time of a prediction that used photographs to `last`."""
    return [
        {
            'used to': last,
            'photograph': one.seen.name,
            'minutes': one.seen.time / MINUTE_S,
            'tube': well,
            'rate_ml_h': round(fitted[well].rate_ml_h),
            'rate_90': '{:.0f} to {:.0f}'.format(*fitted[well].interval_ml_h),
            'tip_cm': _centimetres(error.tip),
            'ahead_cm': _centimetres(error.ahead),
            'line_cm': _centimetres(error.line),
            'above_cm': _centimetres(error.above),
            'tail_cm': _centimetres(error.tail),
        }
        for one in predictions
        for well, error in one.errors.items()
    ]


def _centimetres(length: float) -> float | None:
    """Return a length [m] in centimetres; None if there is none, as where plumes have arrived."""
    return None if np.isnan(length) else round(100 * length, 1)


def map_photographs(rig: Rig, grid: Grid, photographs: Path) -> list[SeenPhoto]:
    """Return the photographs with tracer, registered and mapped on a relative scale.

    Raises:
        InputError: a photograph is missing or cannot be used.
    """
    for name in (BASELINE, *TIMES_MIN):
        if not (photographs / name).is_file():
            raise InputError(f'{photographs / name} is missing; it is in {ORIGINALS}')
    there = [*TIMES_MIN, *(name for name in LATER_MIN if (photographs / name).is_file())]
    states = {name: (photographs / name).read_bytes for name in there}
    clean = [(photographs / BASELINE).read_bytes()]
    baseline = make_baseline(rig, grid, clean)
    scale = relative_calibration(baseline, [states[name] for name in TIMES_MIN])
    baseline = replace(baseline, calibration=scale)
    return [_seen(name, read(), rig, baseline) for name, read in states.items()]


def _seen(name: str, data: bytes, rig: Rig, baseline: Baseline) -> SeenPhoto:
    """Return the photograph `name` (bytes of the file) with its map and plumes."""
    found = concentration_map(data, baseline)
    pixels = baseline.decode(data).pixels
    moved = baseline.sampling.sample(pixels, align(pixels, baseline.features).homography)
    return SeenPhoto(
        (TIMES_MIN | LATER_MIN)[name] * MINUTE_S,
        name,
        cv2.cvtColor(moved, cv2.COLOR_BGR2GRAY),
        found.values,
        plume_lines(found.values, rig, baseline.grid),
        found.status,
        found.deviation,
        found.systematic,
    )


def fitted_rates(rig: Rig, grid: Grid, seen: Sequence[SeenPhoto]) -> dict[str, SourceRate]:
    """Return the rate of every tube, fitted to all photographs `seen` but the first.

    The model starts from the map of the first one.
    """
    sources, _ = at_first_rates(sources_of([_sample(rig, grid, seen)]))
    nothing = sources.fitter.evaluate((), np.zeros(0))
    return {rate.well: rate for rate in sources.beside(nothing)[1]}


def _sample(rig: Rig, grid: Grid, seen: Sequence[SeenPhoto]) -> Sample:
    """Return the sample of a fit, which starts at the first photograph and compares the others."""
    first, *later = seen
    tubes = (
        ScheduleRow(0.0, name, WellRate(_believed(well), 1.0)) for name, well in rig.wells.items()
    )
    maps = np.array([one.values for one in later])
    systematic = np.array([one.systematic for one in later])
    errors = measured_errors(maps, systematic, sands_of(rig, grid), grid)
    return Sample(
        rig=rig,
        schedule=Schedule(tuple(tubes)),
        grid=grid,
        times=np.array([one.time for one in later]),
        observed=maps,
        fitted_frames=len(later),
        noise=Noise(0.0, 0.0, 0.0, 1.0),
        start=first.time,
        held_out_start=later[-1].time,
        end=later[-1].time,
        initial=np.where(_in_plumes(first), without_holes(first.values), 0.0),
        own_deviation=np.nan_to_num(np.array([one.deviation for one in later])),
        shared_errors=replace(errors, scales=()),
        least_scale=1.0,
    )


def causes(photographs: Path) -> list[dict[str, Any]]:
    """Return the misfit of all maps to 10:55 with every effect.

    The effect is fitted together with the rates of the tubes; the first row is without effects.
    """
    rig = load_rig(RIG)
    grid = rig.default_grid(CAUSE_CELL_M)
    seen = map_photographs(rig, grid, photographs)[: len(TIMES_MIN)]
    sources, _ = at_first_rates(sources_of([_sample(rig, grid, seen)]))
    fitter = sources.fitter
    rows = [_cause('none', fitter.evaluate((), np.zeros(0)))]
    for one in library(fitter.samples):
        if one.effect in CAUSES:
            start = np.concatenate([one.first, np.zeros(len(sources.unknown))])
            found = sources.fitted((one,), start, SMOOTHING_WIDTH)
            fit = fitter.evaluate((one, *sources.unknown), found)
            values = (
                f'{parameter.name} {parameter.value(scaled):.3g}'
                for parameter, scaled in zip(one.parameters, found, strict=False)
            )
            rows.append(_cause(f'{one.effect} {", ".join(values)}', fit))
    return rows


def _cause(words: str, fit: Fit) -> dict[str, Any]:
    return {'cause': words, 'misfit': round(fit.fitted_misfit, 3)}


def _in_plumes(seen: SeenPhoto) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) of all plumes of a photograph."""
    return np.any([line.cells for line in seen.plumes.values()], axis=0)


def _believed(well: Well) -> float:
    """Return the median of the prior of a tube [m^3/s]."""
    assert well.believed_rate_ml_h is not None
    return from_ml_h(well.believed_rate_ml_h[0])


def predict(
    rig: Rig,
    grid: Grid,
    used: Sequence[SeenPhoto],
    later: Sequence[SeenPhoto],
    rates: Mapping[str, float],
) -> list[PlumePrediction]:
    """Return the plumes of `later` photographs, from the map of the last one that is `used`.

    Each plume is a tracer of its own, in the flow that all tubes make.
    """
    last = used[-1]
    times = [last.time, *(one.time for one in later)]
    predicted: list[dict[str, PlumeLine]] = [{} for _ in later]
    x, z = np.meshgrid(grid.x, grid.z)
    water = open_water(rig, grid)
    for well, line in last.plumes.items():
        schedule = Schedule(
            tuple(
                ScheduleRow(time, name, WellRate(from_ml_h(on * rate), float(name == well)))
                for time, on in ((0.0, 1.0), (STOPPED_S, 0.0))
                for name, rate in rates.items()
            )
        )
        start = np.where(line.cells, without_holes(last.values), 0.0)
        maps = simulate(rig, schedule, times, grid=grid, initial=start, start=last.time)
        place = rig.wells[well]
        distance = np.hypot(x - place.x_m, z - place.z_m)
        for plumes, values in zip(predicted, maps[1:], strict=True):
            if (values[~water] > FRONT).any():
                plumes[well] = line_of(values, distance, grid, water)
    return [
        PlumePrediction(one, plumes, _errors(rig, plumes, _plumes_of(one, plumes, rig, grid)))
        for one, plumes in zip(later, predicted, strict=True)
    ]


def _plumes_of(
    seen: SeenPhoto, predicted: Mapping[str, PlumeLine], rig: Rig, grid: Grid
) -> dict[str, PlumeLine]:
    """Return the plumes of a photograph; those without a tube that feeds them by the prediction."""
    if seen.time <= STOPPED_S:
        return seen.plumes
    return plume_lines(seen.values, rig, grid, {name: one.cells for name, one in predicted.items()})


def _errors(
    rig: Rig, predicted: Mapping[str, PlumeLine], seen: Mapping[str, PlumeLine]
) -> dict[str, LineDistance]:
    """Return the errors of the plumes that are both predicted and seen."""
    return {
        well: line_error(line, seen[well], (rig.wells[well].x_m, rig.wells[well].z_m))
        for well, line in predicted.items()
        if well in seen
    }


def draw(
    path: Path,
    rig: Rig,
    grid: Grid,
    seen: Sequence[SeenPhoto],
    predictions: Sequence[PlumePrediction],
) -> None:
    """Draw the registered photographs and their maps, with the predicted outlines, into `path`."""
    figure, axes = plt.subplots(2, len(seen), figsize=(5 * len(seen), 10), layout='constrained')
    extent = (0.0, grid.width, 0.0, grid.height)
    by_name = {one.seen.name: one for one in predictions}
    for column, one in enumerate(seen):
        above, below = axes[:, column]
        above.imshow(one.picture, cmap='gray', extent=extent)
        below.imshow(one.values, origin='lower', cmap='Greens', vmin=0, vmax=1, extent=extent)
        found = by_name.get(one.name)
        above.set_title(
            f'{one.name}, {one.time / MINUTE_S:.0f} min: '
            f'{"used" if found is None else "predicted (red)"}'
        )
        for axis in (above, below):
            for line in one.plumes.values():
                axis.plot(line.x, line.z, color='tab:blue', lw=1)
            for line in {} if found is None else found.plumes.values():
                axis.contour(grid.x, grid.z, line.cells, [0.5], colors='red', linewidths=1)
                axis.plot(line.x, line.z, color='red', lw=1, ls='--')
            for well in rig.wells.values():
                axis.plot(well.x_m, well.z_m, 'o', ms=3, color='k')
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=70)
    plt.close(figure)
