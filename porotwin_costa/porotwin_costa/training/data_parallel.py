"""Training by several processes: each takes a part of every batch, and their gradients are summed.

All processes begin with the same weights and draw the same random numbers, so that the weights stay
the same in all of them, as with one process. `torchrun` starts the processes, on one machine or on
several, and tells them about each other:

    torchrun --nproc-per-node 2 -m porotwin_cli train RUN1 RUN2 --rig rig.yaml --output model
"""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, distributed, nn

STARTED_BY_LAUNCHER = 'WORLD_SIZE'
"""Variable of the environment that a launcher sets to the number of processes."""


@contextmanager
def joined() -> Iterator[bool]:
    """Join the processes of a launcher, if there is one; yield whether this one writes files."""
    if int(os.environ.get(STARTED_BY_LAUNCHER, '1')) < 2:
        yield True
        return
    distributed.init_process_group('gloo')
    try:
        yield distributed.get_rank() == 0
    finally:
        distributed.destroy_process_group()


def own_part(chosen: Tensor) -> Tensor:
    """Return the places in the batch `chosen` (batch,) that this process learns from."""
    places = torch.arange(len(chosen))
    if not _together():
        return places
    return places[distributed.get_rank() :: distributed.get_world_size()]


def sum_gradients(weights: Iterable[nn.Parameter]) -> None:
    """Replace every gradient by the sum over all processes; without any, it counts as zero."""
    if not _together():
        return
    for weight in weights:
        if weight.grad is None:
            weight.grad = torch.zeros_like(weight)
        distributed.all_reduce(weight.grad)


def _together() -> bool:
    return distributed.is_available() and distributed.is_initialized()
