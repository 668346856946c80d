"""The account of a closed-loop run: what its bag and the truth say."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, relative_error
from porotwin_core.rig import Rig
from porotwin_core.units import to_ml_h
from porotwin_hub.graph import NAMESPACE
from porotwin_hub.objective_registry import make_objective
from porotwin_recording.bag_reader import BagReader
from porotwin_recording.concentration import ConcentrationMaps

ML = 1e6
"""Millilitres in a cubic metre."""


@dataclass
class Account:
    """What a run of the closed loop came to; one entry per photograph in every series."""

    times: list[float] = field(default_factory=list)
    prediction_error: list[float] = field(default_factory=list)
    corrected_error: list[float] = field(default_factory=list)
    corrected: list[bool] = field(default_factory=list)
    optimise_s: list[float] = field(default_factory=list)
    cycle_s: list[float] = field(default_factory=list)
    rates_ml_h: dict[str, list[float]] = field(default_factory=dict)
    setpoint_times: list[float] = field(default_factory=list)
    observed: dict[float, FloatArray] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)


def read_account(bag: Path) -> Account:
    """Return the account that a bag of the demo holds.

    Raises:
        InputError: the bag cannot be read.
    """
    account = Account()
    reader = BagReader(bag)
    topics = {f'{NAMESPACE}/{name}' for name in ('hub/cycle', 'wells/setpoint', 'asset/new_state')}
    for raw in reader.messages(topics):
        message = reader.decode(raw)
        stamp = message.header.stamp
        time = stamp.sec + stamp.nanosec * 1e-9
        if raw.topic.endswith('hub/cycle'):
            account.times.append(time)
            account.prediction_error.append(message.prediction_error)
            account.corrected_error.append(message.corrected_error)
            account.corrected.append(message.corrected)
            account.optimise_s.append(message.optimise_duration)
            account.cycle_s.append(message.cycle_duration)
            account.remarks += list(message.remarks)
        elif raw.topic.endswith('wells/setpoint'):
            account.setpoint_times.append(time)
            for well in message.wells:
                account.rates_ml_h.setdefault(well.well, []).append(to_ml_h(well.rate))
        else:
            grid = message.tracer.grid
            values = np.asarray(message.tracer.concentration, dtype=float)
            account.observed[time] = values.reshape(grid.nz, grid.nx)
    if not account.times:
        raise InputError(f'{bag}: holds no report of the hub; the loop did not run')
    return account


@dataclass(frozen=True)
class Truth:
    """What the virtual rig knows and the twin does not: its tracer at every photograph."""

    times: NDArray[np.float64]
    grid: Grid
    maps: ConcentrationMaps | FloatArray

    def disallowed(self, rig: Rig) -> FloatArray:
        """Return the tracer truly in the disallowed zone at every time [m^3], shape (nt,)."""
        objective = make_objective(rig, self.grid)
        return np.array([objective.disallowed_tracer(values) for values in self.maps])

    def at(self, time: float) -> FloatArray:
        """Return the true map (nz, nx) at the photograph nearest to `time` [s]."""
        return np.asarray(self.maps[int(np.abs(self.times - time).argmin())])


def summary(account: Account, rig: Rig, controlled: Truth, free: Truth) -> dict[str, float]:
    """Return the figures of a run; volumes in ml, errors relative L2 in the median over photos."""
    with_control, without = controlled.disallowed(rig), free.disallowed(rig)
    image_errors = [
        relative_error(values, controlled.at(time))
        for time, values in account.observed.items()
        if time > 0
    ]
    both = [
        (plain, corrected)
        for plain, corrected in zip(account.prediction_error, account.corrected_error, strict=True)
        if np.isfinite(plain) and np.isfinite(corrected)
    ]
    plain, corrected = np.array(both).T if both else (np.array([np.nan]), np.array([np.nan]))
    return {
        'photographs': len(account.times),
        'disallowed_ml': float(with_control[-1] * ML),
        'disallowed_without_control_ml': float(without[-1] * ML),
        'dose_ml_min': _dose(controlled.times, with_control),
        'dose_without_control_ml_min': _dose(free.times, without),
        'image_error': float(np.nanmedian(image_errors)) if image_errors else float('nan'),
        'prediction_error': float(np.median(plain)),
        'corrected_error': float(np.median(corrected)),
        'corrections': int(np.sum(account.corrected)),
        'cycle_median_s': float(np.median(account.cycle_s)),
        'cycle_longest_s': float(np.max(account.cycle_s)),
        'remarks': len(account.remarks),
    }


def _dose(times: FloatArray, volumes: FloatArray) -> float:
    """Return the integral over time of the tracer in the zone [ml min]."""
    return float(np.trapezoid(volumes * ML, times / 60.0))
