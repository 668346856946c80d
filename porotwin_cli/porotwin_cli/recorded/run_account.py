"""The figures of a closed-loop run: read from its bag, compared with the truth of the rig."""

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import ML
from porotwin_core.geometry.grid import FloatArray, Grid, relative_error
from porotwin_core.rates.rate_periods import orders_by_hand
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig
from porotwin_core.ros.from_messages import rates_from_msg, seconds_from_msg, time_from_msg
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.tables.concentration import ConcentrationMaps


@dataclass
class RunAccount:
    """The course of a closed-loop run, one entry per photograph.

    The hub's reports give `times` [s], relative errors of the predictions [-], whether a correction
    was applied (`corrected`), and the wall-clock times of optimisation and cycle [s].
    The setpoints give `setpoint_times` [s] and their `rates` [m^3/s]. `observed` holds the
    maps (nz, nx) [-] by their time [s].
    """

    times: list[float] = field(default_factory=list)
    prediction_error: list[float] = field(default_factory=list)
    corrected_error: list[float] = field(default_factory=list)
    expected_error: list[float] = field(default_factory=list)
    corrected: list[bool] = field(default_factory=list)
    cycle_s: list[float] = field(default_factory=list)
    rates: list[WellRates] = field(default_factory=list)
    setpoint_times: list[float] = field(default_factory=list)
    observed: dict[float, FloatArray] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def add_report(self, time: float, message: Any) -> None:
        """Add a `CycleReport`."""
        self.times.append(time)
        self.prediction_error.append(message.prediction_error)
        self.corrected_error.append(message.corrected_error)
        self.expected_error.append(getattr(message, 'expected_error', math.nan))
        self.corrected.append(message.corrected)
        self.cycle_s.append(seconds_from_msg(message.cycle_duration))
        self.remarks += list(message.remarks)

    def add_setpoint(self, time: float, message: Any) -> None:
        """Add a `Setpoint`."""
        self.setpoint_times.append(time)
        self.rates.append(rates_from_msg(message.wells))

    def orders(self, rig: Rig) -> int:
        """Return how many setpoints a person has to set at the pumps of `rig`."""
        return orders_by_hand(self.rates, rig)

    def add_state(self, time: float, message: Any) -> None:
        """Add a `NewState`."""
        grid = message.tracer.grid
        values = np.asarray(message.tracer.concentration, dtype=float)
        self.observed[time] = values.reshape(grid.nz, grid.nx)


def read_account(bag: Path) -> RunAccount:
    """Return the account of the run that a bag of the demo holds.

    Raises:
        InputError: the bag cannot be read, or holds no report of the hub.
    """
    account = RunAccount()
    add: dict[str, Callable[[float, Any], None]] = {
        f'{NAMESPACE}/hub/cycle': account.add_report,
        f'{NAMESPACE}/wells/setpoint': account.add_setpoint,
        f'{NAMESPACE}/asset/new_state': account.add_state,
    }
    reader = BagReader(bag)
    for raw in reader.messages(set(add)):
        message = reader.decode(raw)
        add[raw.topic](time_from_msg(message.header.stamp), message)
    if not account.times:
        raise InputError(f'{bag}: holds no report of the hub; the loop did not run')
    return account


@dataclass(frozen=True)
class TrueTracer:
    """The tracer of the virtual rig, which the twin does not know.

    `times` [s] of the photographs have shape (nt,), `maps` (nt, nz, nx).
    """

    times: NDArray[np.float64]
    grid: Grid
    maps: ConcentrationMaps | FloatArray

    def disallowed(self, rig: Rig) -> FloatArray:
        """Return the tracer in the disallowed zone at every time [m^3], shape (nt,).

        Raises:
            InputError: the rig has no control section, or its objective is wrong.
        """
        objective = make_objective(rig, self.grid)
        return np.array([objective.disallowed_tracer(values) for values in self.maps])

    def at(self, time: float) -> FloatArray:
        """Return the map (nz, nx) of the photograph nearest to `time` [s]."""
        return np.asarray(self.maps[int(np.abs(self.times - time).argmin())])


def summary(
    account: RunAccount, rig: Rig, controlled: TrueTracer, free: TrueTracer
) -> dict[str, float]:
    """Return the figures of a run.

    Volumes are in millilitres, the dose in ml min, times in seconds. Errors are medians of relative
    L2 norms over the photographs.

    Args:
        account: the course of the run.
        rig: the rig with its disallowed zone.
        controlled: the true tracer of the run.
        free: the true tracer of the same experiment without control.
    """
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
        'orders': account.orders(rig),
        'image_error': float(np.nanmedian(image_errors)) if image_errors else float('nan'),
        'prediction_error': float(np.median(plain)),
        'corrected_error': float(np.median(corrected)),
        'expected_error': _median(account.expected_error),
        'corrections': int(np.sum(account.corrected)),
        'cycle_median_s': float(np.median(account.cycle_s)),
        'cycle_longest_s': float(np.max(account.cycle_s)),
        'remarks': len(account.remarks),
    }


def _dose(times: FloatArray, volumes: FloatArray) -> float:
    """Return the integral over time of the tracer in the zone [ml min]."""
    return float(trapezoid(volumes * ML, times / 60.0))


def _median(values: Sequence[float]) -> float:
    """Return the median of the finite `values`, NaN without any."""
    finite = [value for value in values if math.isfinite(value)]
    return statistics.median(finite) if finite else math.nan
