"""Tracer of the first map: from before the recording, or seen by a camera that is late."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from porotwin_checks.start import Start
from porotwin_core.basis.units import ML, from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import load_rig
from porotwin_diagnosis.data.initial_tracer import initial_tracer, start_and_tracer
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_recording.tables.concentration import ConcentrationMaps

RIGS = Path(__file__).resolve().parents[2] / 'rigs'

CASES = Path(__file__).resolve().parents[2].parent / 'shared' / 'cases'

RIG = load_rig(RIGS / 'small')
GRID = RIG.grid(100, 60)
TIMES = np.linspace(0.0, 3600.0, 61)
RATE = from_ml_h(500.0)


def pumps(*changes: tuple[float, bool]) -> Schedule:
    """Return the schedule of one pump that is on or off from the given times [s] on."""
    rows = (ScheduleRow(at, 'injector', WellRate(RATE * on, 1.0)) for at, on in changes)
    return Schedule(tuple(rows))


STEADY = pumps((0.0, True))
PULSES = pumps((0.0, True), (400.0, False), (900.0, True), (1500.0, False), (2000.0, True))


def recording(rates: Schedule, stock_at: Callable[[float], float]) -> Recording:
    """Return maps with a plume of `stock_at(t)` [m^3] around the injector, in whole cells."""
    pores = float(RIG.cell_pore_volume(GRID).mean())
    well = RIG.wells['injector']
    x, z = np.meshgrid(GRID.x, GRID.z)
    nearest = np.argsort(np.hypot(x - well.x_m, z - well.z_m), axis=None)

    def read(start: int, stop: int) -> NDArray[np.float32]:
        values = np.zeros((stop - start, GRID.nz * GRID.nx), np.float32)
        for row, time in zip(values, TIMES[start:stop], strict=True):
            row[nearest[: round(stock_at(time) / pores)]] = 1.0
        return values.reshape(-1, GRID.nz, GRID.nx)

    maps = ConcentrationMaps(TIMES, GRID, read)
    return Recording(RIG, commanded=rates, maps=maps, source=Path('run'))


def late(rates: Schedule, lateness: float, factor: float = 1.0) -> Recording:
    """Return what a late camera [s] shows of a rig whose pump delivers `factor` of its rate."""
    return recording(rates, lambda at: factor * rates.injected_stock(0.0, at + lateness))


def used_before(rates: Schedule, held: float) -> Recording:
    """Return what a camera shows of a rig that holds `held` [m^3] of tracer at first."""
    return recording(rates, lambda at: held + rates.injected_stock(0.0, at))


@pytest.mark.parametrize(
    ('lateness', 'factor'),
    [(420.0, 0.85), (420.0, 1.0), (420.0, 1.15), (700.0, 0.85), (700.0, 1.15), (1000.0, 1.0)],
)
def test_pauses_of_the_pump_show_that_a_clock_is_late(lateness: float, factor: float) -> None:
    assert initial_tracer(late(PULSES, lateness, factor)) is None


@pytest.mark.parametrize('held_ml', [80.0, 120.0, 300.0])
def test_pauses_of_the_pump_show_that_a_rig_held_tracer(held_ml: float) -> None:
    assert initial_tracer(used_before(PULSES, held_ml / ML)) is not None


def test_without_a_pause_a_short_lateness_is_a_clock_and_a_long_one_is_not() -> None:
    assert initial_tracer(late(STEADY, 0.12 * 3600.0)) is None
    assert initial_tracer(late(STEADY, 0.5 * 3600.0)) is not None


def test_only_a_change_of_a_rate_tells_a_late_clock_from_tracer_before_the_recording() -> None:
    assert start_and_tracer(late(STEADY, 0.12 * 3600.0))[0] is Start.LATE_OR_USED
    assert start_and_tracer(late(PULSES, 420.0))[0] is not Start.LATE_OR_USED
    assert start_and_tracer(late(STEADY, 0.0))[0] is not Start.LATE_OR_USED
    long_ago = used_before(STEADY, STEADY.injected_stock(0.0, 1800.0))
    assert start_and_tracer(long_ago)[0] is not Start.LATE_OR_USED


def test_a_rig_that_loses_as_much_tracer_as_it_gets_held_it_before() -> None:
    lost = recording(STEADY, lambda _at: 120.0 / ML)
    assert initial_tracer(lost) is not None


@pytest.mark.skipif(not CASES.is_dir(), reason='needs ../shared/cases beside the repository')
def test_a_clock_that_is_late_until_the_first_pause_leaves_the_rig_clean() -> None:
    """The first map is of 624 s. The pump pauses from 437 to 776 s, so both volumes agree."""
    assert initial_tracer(open_recording(CASES / 'case_007')) is None


def test_tracer_far_from_the_wells_is_no_late_clock() -> None:
    """The stock is as much as a late clock would show, but it lies far from the injector."""
    seen = late(PULSES, 420.0)
    maps = seen.present_maps
    turned = ConcentrationMaps(TIMES, GRID, lambda start, stop: maps[start:stop][:, ::-1, ::-1])
    assert initial_tracer(replace(seen, maps=turned)) is not None
