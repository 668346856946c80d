"""Place and volume of a plume, from its signal alone."""

import math

import numpy as np
import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig
from porotwin_imaging.calibrating.plume_evidence import plume_evidence

RIG = Rig.model_validate(
    {
        'name': 'plume',
        'width_m': 1.0,
        'height_m': 0.6,
        'depth_m': 0.01,
        'porosity': 0.4,
        'permeability_m2': 1e-9,
        'viscosity_pa_s': 1e-3,
        'density_kg_m3': 998.0,
        'wells': {'left': {'x_m': 0.3, 'z_m': 0.3}, 'right': {'x_m': 0.75, 'z_m': 0.3}},
    }
)
GRID = RIG.grid(100, 60)
PORES = RIG.cell_pore_volume(GRID)
TIMES = [600.0, 1200.0, 1800.0]
RATE = from_ml_h(400.0)


def disc(volume: float, x: float = 0.3, *, hole: float = 0.0) -> np.ndarray:
    """Return a plume of signal 0.7 that fills `volume` [m^3] of pores, with an empty middle."""
    radius = math.sqrt(volume / (0.4 * 0.01 * math.pi))
    distance = np.hypot(GRID.x[None, :] - x, GRID.z[:, None] - 0.3)
    plume = 0.35 * (1 - np.tanh((distance - radius) / 0.008))
    return np.where(distance < hole * radius, 0.05, plume)


def log(well: str = 'left', concentration: float = 1.0, factor: float = 1.0) -> Schedule:
    return Schedule((ScheduleRow(0.0, well, WellRate(RATE * factor, concentration)),))


def evidence(schedule: Schedule | None, signals=None):
    if signals is None:
        signals = [disc(RATE * time) for time in TIMES]
    return plume_evidence(signals, TIMES, RIG, PORES, grid=GRID, schedule=schedule)


def test_the_plume_fills_the_injected_volume_whatever_the_level_of_its_signal() -> None:
    assert evidence(log()).filled == pytest.approx(1.0, abs=0.05)
    faint = [0.1 * disc(RATE * time) for time in TIMES]
    assert evidence(log(concentration=0.3), faint).filled == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize('factor', [3.0, 1 / 3])
def test_a_wrong_pump_log_shows_in_the_volume(factor) -> None:
    assert evidence(log(factor=factor)).filled == pytest.approx(1 / factor, rel=0.06)


def test_the_wells_of_plume_and_pump_log_are_told() -> None:
    found = evidence(log('right'))
    assert found.told_wells == ('right',)
    assert found.seen_wells == ('left',)


def test_a_plume_without_its_middle_is_hollow() -> None:
    assert evidence(log()).hollow == pytest.approx(1.0, abs=0.05)
    hollow = [disc(RATE * time, hole=0.5) for time in TIMES]
    assert evidence(log(), hollow).hollow < 0.3


def test_a_middle_that_is_left_out_is_hollow_and_a_thin_tube_is_not() -> None:
    near = np.hypot(GRID.x[None, :] - 0.3, GRID.z[:, None] - 0.3)
    left_out = [np.where(near < 0.05, np.nan, disc(RATE * time, hole=0.5)) for time in TIMES]
    assert evidence(log(), left_out).hollow < 0.3
    tube = np.abs(GRID.x[None, :] - 0.3) < 0.006
    behind = [np.where(tube, np.nan, disc(RATE * time)) for time in TIMES]
    assert evidence(log(), behind).hollow > 0.9


def test_noise_has_no_plume_and_no_log_no_volume() -> None:
    generator = np.random.default_rng(2)
    noise = [np.full(GRID.shape, -0.01) + 1e-6 * generator.normal(size=GRID.shape)] * 3
    assert math.isnan(evidence(log(), noise).filled)
    found = evidence(None)
    assert math.isnan(found.filled)
    assert found.told_wells == ()
    assert found.seen_wells == ('left',)


def test_a_hand_in_one_photograph_does_not_change_the_volume() -> None:
    signals = [disc(RATE * time) for time in TIMES]
    signals[1] = np.where(GRID.x[None, :] > 0.5, 0.7, signals[1])
    times = [600.0, 1200.0, 1500.0, 1800.0]
    more = [*signals[:2], disc(RATE * 1500.0), signals[2]]
    found = plume_evidence(more, times, RIG, PORES, grid=GRID, schedule=log())
    assert found.filled == pytest.approx(1.0, abs=0.05)


def test_water_behind_the_tracer_is_no_hollow_plume() -> None:
    pulse = Schedule((*log().rows, ScheduleRow(1300.0, 'left', WellRate(RATE, 0.0))))
    signals = [disc(RATE * 600.0), disc(RATE * 1200.0), disc(RATE * 1800.0, hole=0.6)]
    found = evidence(pulse, signals)
    assert found.filled == pytest.approx(1.0, abs=0.05)
    assert found.hollow == pytest.approx(1.0, abs=0.05)


def test_clean_water_that_flows_past_a_resting_well_is_no_hollow_plume() -> None:
    rest, begin = WellRate(0.0, 1.0), WellRate(RATE, 1.0)
    rows = (ScheduleRow(650.0, 'left', rest), ScheduleRow(650.0, 'right', begin))
    gone = [disc(RATE * 650.0, 0.35, hole=0.9) + disc(RATE * (time - 650.0), 0.75)
            for time in TIMES[1:]]  # fmt: skip
    found = evidence(Schedule((*log().rows, *rows)), [disc(RATE * TIMES[0]), *gone])
    assert found.hollow == pytest.approx(1.0, abs=0.05)


def test_hidden_cells_count_as_clean() -> None:
    hidden = [np.where(GRID.x[None, :] > 0.6, np.nan, disc(RATE * time)) for time in TIMES]
    assert evidence(log(), hidden).filled == pytest.approx(1.0, abs=0.05)


def test_the_distance_from_plume_to_injecting_well_is_told() -> None:
    assert evidence(log()).apart == 0.0
    assert evidence(None).apart == 0.0
    assert evidence(log('right')).apart > 0.2
    mirrored = [disc(RATE * time, x=0.7) for time in TIMES]
    assert evidence(log(), mirrored).apart > 0.2
