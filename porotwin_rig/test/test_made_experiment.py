"""Experiments written by the virtual rig: complete experiment folders without their effects."""

from pathlib import Path

import numpy as np
import pytest
from rig_examples import make_rig, rates

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Control, FixedWell
from porotwin_recording.experiment.experiment_folder import read_folder
from porotwin_recording.tables.concentration import open_maps
from porotwin_rig.effects import parse_effects
from porotwin_rig.made_experiment import make_experiment, signals
from porotwin_rig.map_camera import MapNoise
from porotwin_rig.virtual_rig import VirtualRig

PAUSE = rates(injector=(0.0, 1.0), producer=0.0)
PUMP = rates(injector=(500.0, 1.0), producer=-500.0)
CELL_M = 0.006
"""Size of the elements of the virtual rig [m]; the default is finer and slower."""
COMMANDED = Schedule.from_rates([(0.0, PUMP), (130.0, PAUSE), (200.0, PUMP)])


def test_folder_holds_rig_rates_maps_and_photographs(tmp_path: Path) -> None:
    rig = make_rig()
    made = make_experiment(
        tmp_path / 'run',
        VirtualRig(rig, effects=parse_effects('decay:rate=1e-4'), cell=CELL_M),
        commanded=COMMANDED,
        duration=300.0,
        photo_interval=60.0,
        seed=4,
        noise=MapNoise(),
        photo_width_px=320,
        truth=tmp_path / 'truth.nc',
    )
    found = read_folder(tmp_path / 'run')
    assert found.rig.effects == ()  # the effects stay secret
    assert found.rig.wells == rig.wells
    assert found.rig.camera is not None
    assert found.commanded == COMMANDED
    assert found.maps is not None
    np.testing.assert_array_equal(found.maps.times, np.arange(0.0, 301.0, 60.0))
    assert [photo.role for photo in found.photos] == ['baseline'] + ['state'] * 5
    assert found.photos[3].read()[:2] == b'\xff\xd8'
    truth = open_maps(tmp_path / 'truth.nc', rig)
    gap = np.linalg.norm(found.maps[-1] - truth[-1]) / np.linalg.norm(truth[-1])
    assert gap == pytest.approx(made.noise_floor, rel=0.2)
    assert made.injected == pytest.approx(from_ml_h(500.0) * 230.0)


def test_a_well_rests_in_the_pauses_that_the_folder_announces(tmp_path: Path) -> None:
    well = FixedWell(rate_ml_h=500.0, concentration=1.0, pauses_min=((1.0, 2.0),))
    control = Control(wells=(), producer='producer', fixed={'injector': well})
    made = make_experiment(
        tmp_path / 'run',
        VirtualRig(make_rig().model_copy(update={'control': control}), cell=CELL_M),
        commanded=Schedule.constant(PUMP),
        duration=180.0,
        photo_interval=60.0,
        seed=4,
    )
    known = read_folder(tmp_path / 'run').known_rates
    assert known is not None
    assert made.injected == pytest.approx(known.injected_stock(0.0, 180.0))
    assert made.injected == pytest.approx(120.0 * from_ml_h(500.0))


def test_every_step_of_a_slow_experiment_is_told(tmp_path: Path) -> None:
    shares: list[float] = []
    make_experiment(
        tmp_path / 'run',
        VirtualRig(make_rig(), effects=parse_effects('buoyancy:density_difference=1'), cell=CELL_M),
        commanded=COMMANDED,
        duration=300.0,
        photo_interval=300.0,
        seed=4,
        progress=shares.append,
    )
    assert len(shares) >= 20  # steps of 15 s between two maps
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_without_noise_maps_are_the_truth(tmp_path: Path) -> None:
    made = make_experiment(
        tmp_path / 'run',
        VirtualRig(make_rig(), cell=CELL_M),
        commanded=COMMANDED,
        duration=90.0,
        photo_interval=30.0,
        seed=4,
        truth=tmp_path / 'truth.nc',
    )
    assert made.noise_floor == 0.0
    maps = read_folder(tmp_path / 'run').maps
    assert maps is not None
    np.testing.assert_array_equal(maps[:], open_maps(tmp_path / 'truth.nc', make_rig())[:])


def test_clock_effect_shows_the_rig_at_another_time() -> None:
    rig = make_rig()
    grid = rig.grid(60, 40)
    late = VirtualRig(rig, effects=parse_effects('clock:offset=90'), cell=0.01)
    plain = VirtualRig(rig, cell=0.01)
    shown = dict(signals(late, COMMANDED, times=[0.0, 60.0], grid=grid))
    true = dict(signals(plain, COMMANDED, times=[0.0, 90.0, 150.0], grid=grid))
    for stamp, moment in ((0.0, 90.0), (60.0, 150.0)):
        apart = np.abs(shown[stamp] - true[moment]).sum() / true[moment].sum()
        assert apart < 0.06  # the plain rig stops once more on its way
    early = VirtualRig(rig, effects=parse_effects('clock:offset=-90'), cell=0.01)
    assert next(signals(early, COMMANDED, times=[60.0], grid=grid))[1].max() == 0.0


def test_folder_in_use_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'rig.yaml').write_text('name: mine')
    with pytest.raises(InputError, match='already'):
        make_experiment(
            tmp_path,
            VirtualRig(make_rig()),
            commanded=COMMANDED,
            duration=60.0,
            photo_interval=30.0,
            seed=1,
        )
    assert (tmp_path / 'rig.yaml').read_text() == 'name: mine'


def test_impossible_times_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='positive'):
        make_experiment(
            tmp_path / 'x',
            VirtualRig(make_rig()),
            commanded=COMMANDED,
            duration=0.0,
            photo_interval=30.0,
            seed=1,
        )
