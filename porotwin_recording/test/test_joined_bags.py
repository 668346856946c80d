"""Tests of bags in one folder that are no single recording."""

from pathlib import Path

import pytest
from recording_examples import controlled_rig, write_live_bag

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig, write_rig
from porotwin_core.ros.conversions import rates_to_msg, rig_to_msg
from porotwin_msgs.msg import NewState, Setpoint
from porotwin_recording.experiment.recording import open_recording


def write_rig_bag(path: Path, rig: Rig) -> None:
    write_live_bag(path, [('/lab/rig/description', rig_to_msg(rig))])


@pytest.mark.parametrize(('first', 'second'), [('a', 'b'), ('a.mcap', 'b.mcap')])
@pytest.mark.parametrize('change', [{'name': 'other'}, {'width_m': 0.5}])
def test_bags_of_two_rigs_in_one_folder_are_refused(
    tmp_path: Path, first: str, second: str, change: dict[str, object]
) -> None:
    day, rig = tmp_path / 'day', controlled_rig()
    day.mkdir()
    other = rig.model_copy(update=change)
    write_rig_bag(day / first, rig)
    write_rig_bag(day / second, other)
    with pytest.raises(InputError) as error:
        open_recording(day)
    line = str(error.value)
    both = f"{day / first} of 'bench' and {day / second} of '{other.name}'"
    assert f'{both}, which differ in {next(iter(change))}; read' in line
    write_rig(rig, tmp_path / 'rig.yaml')
    open_recording(day, rig=tmp_path / 'rig.yaml')


@pytest.mark.parametrize('names', [('a', 'b'), ('run_0.mcap', 'run_1.mcap')])
def test_a_rig_may_be_corrected_from_bag_to_bag_and_within_one(
    tmp_path: Path, names: tuple[str, str]
) -> None:
    tmp_path.joinpath('day').mkdir()
    rig = controlled_rig()
    key = 'porosity' if names[0] == 'a' else 'width_m'
    for name, value in zip(names, (0.4, 0.41), strict=True):
        write_rig_bag(tmp_path / 'day' / name, rig.model_copy(update={key: value}))
    assert getattr(open_recording(tmp_path / 'day').rig, key) == 0.41


def write_experiment(path: Path, rate: float, tracer: float) -> None:
    """Write a bag with a setpoint and a map, both at time 0."""
    state = NewState()
    state.tracer.grid.nx = state.tracer.grid.nz = 2
    state.tracer.grid.width, state.tracer.grid.height = 0.4, 0.3
    state.tracer.concentration = [0.0, 0.0, 0.0, tracer]
    messages = [
        ('/lab/rig/description', rig_to_msg(controlled_rig())),
        ('/lab/wells/setpoint', Setpoint(wells=rates_to_msg({'in': WellRate(rate, 1.0)}))),
        ('/lab/asset/new_state', state),
    ]
    write_live_bag(path, messages)


@pytest.mark.parametrize(
    ('rate', 'tracer', 'topic'), [(2e-7, 0.5, 'wells/setpoint'), (1e-7, 0.6, 'asset/new_state')]
)
def test_two_experiments_with_the_same_times_are_refused(
    tmp_path: Path, rate: float, tracer: float, topic: str
) -> None:
    monday, tuesday = tmp_path / 'week' / 'monday', tmp_path / 'week' / 'tuesday'
    write_experiment(monday, 1e-7, 0.5)
    write_experiment(tuesday, rate, tracer)
    with pytest.raises(InputError) as error:
        open_recording(tmp_path / 'week')
    line = str(error.value)
    assert f"{monday} and {tuesday} have the same times, but differ in '/lab/{topic}'" in line
    assert f'read {monday} or {tuesday} alone' in line


def test_two_copies_of_one_bag_are_read_once(tmp_path: Path) -> None:
    for name in ('run', 'copy'):
        write_experiment(tmp_path / 'both' / name, 1e-7, 0.5)
    recording = open_recording(tmp_path / 'both')
    assert recording.times.tolist() == [0.0]
    assert any('does its folder hold two copies of one bag?' in line for line in recording.remarks)
