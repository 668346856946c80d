"""Fixtures for the tests of COSTA: a toy rig, its models, its experiments and their pairs."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from costa_examples import NETWORKS, TIME_STEP, ToyModel, injecting, toy_rig
from undrawn_pictures import undrawn

from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig, write_rig
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.data.dataset import Dataset
from porotwin_costa.data.dataset_builder import build_dataset
from porotwin_costa.data.frames import Frames
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.training import train

__all__ = ['undrawn']


@pytest.fixture(autouse=True, scope='session')
def _one_thread() -> None:
    """Let torch use one thread: the same numbers on every machine."""
    torch.set_num_threads(1)


@pytest.fixture(scope='session')
def rig() -> Rig:
    return toy_rig()


@pytest.fixture(scope='session')
def grid(rig: Rig) -> Grid:
    return rig.grid(30, 20)


@pytest.fixture(scope='session')
def model(rig: Rig, grid: Grid) -> ToyModel:
    return ToyModel(rig, grid)


@pytest.fixture(scope='session')
def observe(rig: Rig, grid: Grid):
    """Return a function that makes the frames of a schedule with the less diffusive model."""
    truth = ToyModel(rig, grid, sharp=True)

    def run(schedule: Schedule, count: int, name: str = 'experiment') -> Frames:
        times = np.arange(count) * TIME_STEP
        frames = [np.zeros(grid.shape)]
        for time in times[:-1]:
            frames.append(truth.predict(frames[-1], schedule.at(time), TIME_STEP))
        return Frames(times, np.array(frames), schedule, name=name)

    return run


@pytest.fixture(scope='session')
def training_frames(observe) -> list[Frames]:
    """Return two experiments of 25 frames."""
    return [
        observe(Schedule.constant(injecting(left=400.0)), 25, 'left'),
        observe(Schedule.constant(injecting(right=500.0)), 25, 'right'),
    ]


@pytest.fixture(scope='session')
def validation_frames(observe) -> Frames:
    """Return a third experiment, which training keeps for validation."""
    return observe(Schedule.constant(injecting(left=200.0, right=200.0)), 15, 'both')


@pytest.fixture(scope='session')
def unseen_frames(observe) -> Frames:
    """Return an experiment whose rates change, and are in none of the others."""
    rates = [(0.0, injecting(left=300.0, right=100.0)), (300.0, injecting(left=50.0, right=350.0))]
    return observe(Schedule.from_rates(rates), 25, 'unseen')


@pytest.fixture(scope='session')
def build(rig: Rig, grid: Grid, model: ToyModel):
    """Return a function that makes the data set of some experiments."""

    def run(*experiments: Frames, time_step: float = TIME_STEP, of: Rig = rig) -> Dataset:
        return build_dataset(
            experiments,
            of,
            grid=grid,
            time_step=time_step,
            predict=model.predict,
            residual=model.residual,
        )

    return run


@pytest.fixture(scope='session')
def dataset(build, training_frames: list[Frames]) -> Dataset:
    """Return the 48 pairs of the training experiments."""
    return build(*training_frames)


@pytest.fixture(scope='module')
def client() -> Iterator[Any]:
    """Return a client of real nodes, see `costa_graph`."""
    from costa_graph import Client

    client = Client()
    yield client
    client.close()


@pytest.fixture(scope='module')
def rig_file(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the path of the toy rig's rig.yaml."""
    path = tmp_path_factory.mktemp('rig') / 'rig.yaml'
    write_rig(rig, path)
    return path


@pytest.fixture(scope='session', params=list(NETWORKS))
def trained(request: pytest.FixtureRequest, dataset: Dataset) -> CorrectiveModel:
    """Return a trained model, for tests of gate and files; how well it learns is no matter."""
    settings = TrainingSettings(epochs=8, learning_rate=3e-3, patience=40)
    return replace(train(dataset, NETWORKS[request.param], settings, seed=21), trust=0.9)
