"""Two runs beside each other: their differences and their results."""

import math
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from porotwin_cli.recorded.run_account import read_account
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import MINUTE_S, ML
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.geometry.grid import FloatArray, conservative_resample, relative_error
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_core.rates.wells import Schedule
from porotwin_diagnosis.data.noise_estimation import measure_noise
from porotwin_recording.experiment.catalogue import catalogue_entry
from porotwin_recording.experiment.known_verdicts import KnownVerdicts
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_siblings.zone_measure import ZoneMeasure


@dataclass(frozen=True)
class RunComparison:
    """The figures of two runs by name, and how the runs differ.

    Attributes:
        figures: of each run; a number, or a text. NaN and empty: not known.
        keys: keys of `rig.yaml` that differ.
        distances: the relative difference [-] of the maps of both runs at the times [s] of the
            first run that the second one has too, and that show tracer; empty without such maps.
    """

    figures: tuple[dict[str, Any], dict[str, Any]]
    keys: tuple[str, ...]
    distances: dict[float, float]


def compare_runs(first: Path, second: Path) -> RunComparison:
    """Return the comparison of the recordings at two paths.

    Raises:
        InputError: one of them cannot be read.
    """
    one, other = open_recording(first), open_recording(second)
    keys = tuple(one.rig.keys_that_differ(other.rig))
    return RunComparison((_figures(one), _figures(other)), keys, _distances(one, other))


def _figures(run: Recording) -> dict[str, Any]:
    entry = catalogue_entry(run.source, KnownVerdicts(run.source.absolute().parent))
    rates, end = run.known().rates or Schedule(), run.end
    injected = {
        f'injected by {well} [ml]': ML
        * sum(
            (high - low) * max(held[well].rate, 0.0)
            for low, high, held in rates.intervals(0.0, end)
            if well in held
        )
        for well in rates.wells
    }
    return {
        'rig': entry.rig,
        'duration [min]': end / MINUTE_S,
        'maps': 0 if run.maps is None else len(run.times),
        'setpoints': entry.setpoints,
        'stock injected [ml]': ML * rates.injected_stock(0.0, end),
        **{name: volume for name, volume in injected.items() if volume > 0.0},
        **_zone_figures(run),
        **_cycle_figures(run.source),
        'effects': ', '.join(entry.effects),
        'COSTA': entry.costa.partition(',')[0],
        'calibration': entry.calibration,
        'diagnosed': entry.diagnosed,
    }


def _zone_figures(run: Recording) -> dict[str, float]:
    """Return the tracer that the maps show in the zone of the objective; nothing without one.

    The mean of the noise of clean sand, which is above zero in clipped maps, is taken away.
    """
    if run.maps is None or run.rig.control is None:
        return {}
    zone = ZoneMeasure.of(run.rig, run.grid)
    seen = np.stack([run.maps[number] for number in run.known().looked_at])
    (clean,) = measure_noise(seen).expected(np.zeros(1))
    left = np.array([zone.tracer(np.nan_to_num(one - clean)) for one in run.maps])
    tracer = ML * np.maximum(left, 0.0)  # noise is no negative tracer
    if not np.isfinite(tracer).all():
        return {}
    return {
        'tracer in the zone at the end [ml]': float(tracer[-1]),
        'dose in the zone [ml min]': float(trapezoid(tracer, run.times / MINUTE_S)),
    }


def _cycle_figures(source: Path) -> dict[str, Any]:
    """Return figures from the reports of the hub; none without a twin."""
    with suppress(InputError):
        account = read_account(source)
        errors = np.array(account.corrected_error)
        return {
            'forecast error, median [-]': float(np.nanmedian(errors))
            if np.isfinite(errors).any()
            else math.nan,
            'remarks': len(account.remarks),
        }
    return {}


def _distances(one: Recording, other: Recording) -> dict[float, float]:
    """Return the relative differences of maps of the same times, on the coarser grid."""
    if one.maps is None or other.maps is None:
        return {}
    if (one.rig.width_m, one.rig.height_m) != (other.rig.width_m, other.rig.height_m):
        return {}
    shape = min(one.grid.shape, other.grid.shape)
    found = {}
    for number, time in enumerate(one.times):
        match = int(np.argmin(np.abs(other.times - time)))
        if abs(other.times[match] - time) < SAME_STAMP_S:
            pair = (_on(one.maps[number], shape), _on(other.maps[match], shape))
            if (pair[1] > PLUME_THRESHOLD).any():  # noise alone differs by any share
                found[float(time)] = relative_error(*pair)
    return found


def _on(values: Any, shape: tuple[int, int]) -> FloatArray:
    return conservative_resample(np.nan_to_num(np.asarray(values, dtype=float)), shape)
