"""Tests of the sample recording: other libraries read it, and the README's first steps work."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from porotwin_core.rig import load_rig
from porotwin_imaging.baseline.baseline import make_baseline
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_imaging.tracer.calibration import load_calibration
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_solver.model.simulation import simulate

BAGS = Path(__file__).resolve().parents[1] / 'bags'
PHOTOGRAPHS = 13


@pytest.fixture(scope='module')
def sample() -> Recording:
    return open_recording(BAGS / 'sample')


def test_rosbags_reads_the_sample_with_its_own_definitions() -> None:
    with AnyReader([BAGS / 'sample']) as reader:
        topics = {connection.topic for connection in reader.connections}
        assert '/porotwin/hub/cycle' in topics
        states = [c for c in reader.connections if c.topic == '/porotwin/asset/new_state']
        messages = [
            reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages(states)
        ]
    assert len(messages) == PHOTOGRAPHS
    grid = messages[-1].tracer.grid
    assert (grid.nx, grid.nz) == (187, 112)
    assert len(messages[-1].tracer.concentration) == 187 * 112


def test_mcap_reads_the_sample_with_its_own_definitions() -> None:
    (file,) = (BAGS / 'sample').glob('*.mcap')
    with file.open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        setpoints = [
            message
            for _, _, _, message in reader.iter_decoded_messages(
                topics=['/porotwin/wells/setpoint']
            )
        ]
    assert len(setpoints) == PHOTOGRAPHS
    assert {well.well for well in setpoints[0].wells} >= {'injector', 'producer', 'control1'}


def test_the_sample_holds_its_rig(sample: Recording) -> None:
    rig = load_rig(BAGS.parent / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    assert sample.rig.wells == rig.wells
    assert sample.rig.control == rig.control
    assert sample.rig.camera is not None


def test_fields_that_are_newer_than_the_sample_have_default_values() -> None:
    bag = BagReader(BAGS / 'sample')
    name = '/porotwin/rig/description'
    assert 'objective_parameters' not in bag.topics[name].definition
    (message,) = bag.messages([name])
    (control,) = bag.decode(message).control
    assert (control.objective, control.objective_parameters) == ('', [])
    assert control.producer == 'producer'


def test_the_photographs_give_the_recorded_maps(sample: Recording) -> None:
    calibration = load_calibration(BAGS / 'sample_calibration.yaml')
    baselines = [photo.read() for photo in sample.photos if photo.role == 'baseline']
    baseline = make_baseline(sample.rig, sample.grid, baselines, calibration=calibration)
    last = sample.photos[-1]
    again = concentration_map(last.read(), baseline).values
    recorded = sample.concentration[-1]
    assert last.time == sample.times[-1]
    assert np.linalg.norm(again - recorded) < 0.05 * np.linalg.norm(recorded)


def test_the_physics_based_model_predicts_the_last_map(sample: Recording) -> None:
    assert sample.measured is not None
    model = simulate(sample.rig, sample.measured, sample.times[-1:], grid=sample.grid)
    observed = sample.concentration[-1]
    assert np.linalg.norm(model[0] - observed) < 0.08 * np.linalg.norm(observed)
