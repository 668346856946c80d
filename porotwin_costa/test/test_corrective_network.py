"""All networks: shapes, finite answers, windows."""

import pytest
import torch
from costa_examples import rig_fields, scaled_rates

from porotwin_costa.networks import ARCHITECTURES, CorrectiveNetwork, Window, parameter_count


@pytest.mark.parametrize('name', ARCHITECTURES)
@pytest.mark.parametrize(('nx', 'nz'), [(187, 112), (94, 56), (280, 150), (19, 11)])
def test_answer_has_the_size_of_the_grid(name, nx, nz):
    network = ARCHITECTURES[name].network(rig_fields(nx, nz))
    with torch.inference_mode():
        answer = network(torch.rand(2, nz, nx), scaled_rates(2))
    assert answer.shape == (2, nz, nx)
    assert torch.isfinite(answer).all()


@pytest.mark.parametrize(
    'name', [name for name, found in ARCHITECTURES.items() if found.reach is not None]
)
def test_a_window_has_the_answer_of_the_whole_map_beyond_the_reach(name):
    torch.manual_seed(4)
    network = ARCHITECTURES[name].network(rig_fields(40, 30, change=0.5))
    with torch.no_grad():  # a network may begin with weights of zero
        for weight in network.parameters():
            weight.add_(0.01 * torch.randn(weight.shape))
    reach = ARCHITECTURES[name].reach + 1  # a flux limiter sees one cell more
    plume = torch.zeros(2, 30, 40)
    plume[:, 8:20, 10:28] = torch.rand(2, 12, 18)
    windows = [Window(2, 5, 24, 26), Window(6, 14, 24, 26)]
    with torch.inference_mode():
        whole = network(plume, scaled_rates(2))
        parts = network.forward_windows(plume, scaled_rates(2), windows)
    assert parts.shape == (2, 24, 26)
    assert float(whole.abs().max()) > 1e-3
    inside = slice(reach, -reach)
    for part, sample, window in zip(parts, whole, windows, strict=True):
        cut = window.cells(sample)
        # float32 round-off of convolutions over other sizes
        assert torch.allclose(part[inside, inside], cut[inside, inside], atol=1e-6)


class _Pointwise(CorrectiveNetwork):
    """Returns twice the concentration, plus the first rate."""

    def forward(self, concentration, rates):
        return 2 * concentration + rates[:, :1, None]


def test_windows_of_a_simple_network_are_windows_of_its_input():
    field, rates = torch.rand(2, 5, 6), torch.tensor([[1.0, 0.0], [2.0, 0.0]])
    windows = [Window(0, 1, 3, 4), Window(2, 2, 3, 4)]
    answer = _Pointwise().forward_windows(field, rates, windows)
    assert torch.equal(answer[0], 2 * field[0, :3, 1:5] + 1.0)
    assert torch.equal(answer[1], 2 * field[1, 2:, 2:] + 2.0)


def test_window_cuts_cells_and_the_faces_between_them():
    window = Window(1, 2, 3, 4)
    assert window.cells(torch.zeros(7, 9)).shape == (3, 4)
    assert window.right_faces(torch.zeros(7, 8)).shape == (3, 3)
    assert window.up_faces(torch.zeros(6, 9)).shape == (2, 4)


def test_a_network_without_a_forward_cannot_answer():
    with pytest.raises(NotImplementedError):
        CorrectiveNetwork()(torch.zeros(1, 2, 2), torch.zeros(1, 2))


def test_weights_are_counted():
    assert parameter_count(torch.nn.Linear(3, 2)) == 8
