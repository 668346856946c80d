"""Batches: scaled samples, and their loss on windows."""

import numpy as np
import pytest
import torch

from porotwin_costa.data.scaling import Scaling
from porotwin_costa.networks import CorrectiveNetwork
from porotwin_costa.training.batches import TRACER_PRESENT, Batches


@pytest.mark.parametrize('standardise', [True, False])
def test_scaled_samples_have_the_chosen_scale(dataset, standardise):
    batches = Batches.of(dataset, Scaling.of(dataset, standardise=standardise))
    concentration = batches.concentration.numpy()
    if standardise:
        # float32 of thousands of values
        assert abs(concentration.mean()) < 1e-4
        assert concentration.std() == pytest.approx(1.0, rel=1e-4)
    else:
        assert np.array_equal(concentration, dataset.predicted)
        assert batches.tracer_present == TRACER_PRESENT
    assert float(batches.rates.abs().max()) == pytest.approx(1.0)
    assert float(batches.target.square().mean()) == pytest.approx(1.0, rel=1e-4)
    present = batches.concentration > batches.tracer_present
    # exactly where the concentration is above the threshold, but for round-off at it
    assert np.mean(present.numpy() != (dataset.predicted > TRACER_PRESENT)) < 1e-4


class _Zero(CorrectiveNetwork):
    """Answers zero and keeps the windows that it gets."""

    def __init__(self):
        super().__init__()
        self.windows = []

    def forward_windows(self, concentration, rates, windows):
        self.windows += windows
        return torch.zeros(len(windows), windows[0].nz, windows[0].nx)


def test_windows_lie_inside_the_grid_around_cells_with_tracer(dataset):
    batches = Batches.of(dataset, Scaling.of(dataset, standardise=False))
    chosen = torch.arange(10, 20)
    windows = batches.windows(chosen, 8, torch.Generator().manual_seed(3))
    nz, nx = dataset.grid.shape
    for window, sample in zip(windows, chosen, strict=True):
        assert (window.nz, window.nx) == (8, 8)
        assert 0 <= window.z <= nz - 8
        assert 0 <= window.x <= nx - 8
        assert float(window.cells(batches.concentration[sample]).max()) > TRACER_PRESENT


def test_the_rim_of_a_window_does_not_count(dataset):
    batches = Batches.of(dataset, Scaling.of(dataset, standardise=False))
    chosen = torch.tensor([12])
    (window,) = batches.windows(chosen, 8, torch.Generator().manual_seed(3))
    loss = batches.window_loss(_Zero(), chosen, [window], reach=2)
    inside = window.cells(batches.target[12])[2:-2, 2:-2]
    assert float(loss) == pytest.approx(float(inside.square().mean()))


def test_a_window_larger_than_the_grid_is_the_whole_map(dataset):
    batches = Batches.of(dataset, Scaling.of(dataset, standardise=False))
    chosen = torch.tensor([12])
    windows = batches.windows(chosen, 99, torch.Generator().manual_seed(3))
    loss = batches.window_loss(_Zero(), chosen, windows, reach=6)
    assert float(loss) == pytest.approx(float(batches.target[12].square().mean()))
