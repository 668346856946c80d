"""Two processes on gloo learn what one process learns."""

import os
import socket
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest
import torch

from porotwin_costa.data.dataset import load_dataset
from porotwin_costa.networks import architecture
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.data_parallel import joined, own_part
from porotwin_costa.training.training import train

SETTINGS = TrainingSettings(epochs=2, batch_size=5, window=12, patience=40)
"""The last batch has an odd number of samples, so that the processes have unequal parts."""


def learn(rank: int, port: int, pairs: Path, model: Path) -> bool:
    """Train in this process as a launcher would start it; return whether it writes files."""
    team = {'MASTER_ADDR': '127.0.0.1', 'MASTER_PORT': str(port), 'WORLD_SIZE': '2'}
    os.environ.update(team, RANK=str(rank))
    with joined() as writes:
        learned = train(load_dataset(pairs), architecture('local'), SETTINGS, seed=3)
    if writes:
        learned.save(model)
    return writes


def test_alone_a_process_learns_from_everything_and_writes() -> None:
    with joined() as writes:
        assert writes
        assert own_part(torch.arange(5)).tolist() == [0, 1, 2, 3, 4]


@pytest.mark.slow
def test_two_processes_learn_the_weights_of_one(dataset, tmp_path: Path) -> None:
    from porotwin_costa.correction.corrective_model import CorrectiveModel

    one = train(dataset, architecture('local'), SETTINGS, seed=3)
    dataset.save(tmp_path / 'pairs')
    with socket.create_server(('127.0.0.1', 0)) as free:
        port = free.getsockname()[1]
    # forked processes have torch already, and need not import it again
    with ProcessPoolExecutor(2, get_context('fork')) as processes:
        begun = [
            processes.submit(learn, rank, port, tmp_path / 'pairs', tmp_path / 'model')
            for rank in (0, 1)
        ]
    wrote = [process.result() for process in begun]
    assert wrote == [True, False]
    both = CorrectiveModel.load(tmp_path / 'model').network.state_dict()
    for name, weights in one.network.state_dict().items():
        assert torch.allclose(both[name], weights, rtol=1e-3, atol=1e-5), name
