import numpy as np
import pytest
import torch
from torch import nn

from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.rig import Boundaries
from porotwin_costa.flow_shape import homogeneous_flow
from porotwin_costa.network import (
    COMPLEX_RIG,
    HOMOGENEOUS_RIG,
    LOCAL,
    NetworkSettings,
    build_network,
    parameter_count,
)

WELLS = {'injector': (0.2, 0.2), 'control': (0.5, 0.4), 'producer': (0.7, 0.16)}


def _flow(nx: int, nz: int):
    return homogeneous_flow(Grid(nx, nz, 0.934, 0.562), WELLS, Boundaries())


def _rates(count: int) -> torch.Tensor:
    return torch.tensor([[1.0, 1.0, 0.5, 0.0, -1.5, 0.0]]).repeat(count, 1)


@pytest.mark.parametrize('settings', [HOMOGENEOUS_RIG, COMPLEX_RIG, LOCAL])
@pytest.mark.parametrize(('nx', 'nz'), [(187, 112), (94, 56), (280, 150), (19, 11)])
def test_answer_has_the_size_of_the_grid(settings, nx, nz):
    network = build_network((nz, nx), len(WELLS), settings, _flow(nx, nz))
    with torch.inference_mode():
        answer = network(torch.rand(2, nz, nx), _rates(2))
    assert answer.shape == (2, nz, nx)
    assert torch.isfinite(answer).all()


def test_layers_are_those_the_paper_describes():
    network = build_network((56, 94), len(WELLS), HOMOGENEOUS_RIG)
    kinds = [type(layer) for layer in network.convolutions]
    assert kinds == [nn.Conv2d, nn.ReLU, nn.MaxPool2d] * 5
    assert all(layer.out_features == 100 for layer in network.dense)
    assert len(network.dense) == 3
    complex_rig = build_network((56, 94), len(WELLS), COMPLEX_RIG)
    assert [type(layer) for layer in complex_rig.convolutions].count(nn.MaxPool2d) == 2
    assert [type(layer) for layer in complex_rig.convolutions].count(nn.Conv2d) == 7
    assert len(complex_rig.dense) == 5


def test_every_dense_layer_sees_the_rates():
    network = build_network((20, 30), len(WELLS), COMPLEX_RIG)
    assert [layer.in_features for layer in network.dense[1:]] == [100 + 2 * len(WELLS)] * 4


def test_last_row_and_column_of_an_odd_grid_matter_to_the_paper_network():
    torch.manual_seed(5)
    network = build_network((11, 19), len(WELLS), HOMOGENEOUS_RIG)
    blank = torch.zeros(1, 11, 19)
    corner = blank.clone()
    corner[0, -1, -1] = 5.0
    assert not torch.equal(network(blank, _rates(1)), network(corner, _rates(1)))


def _local(seed: int = 3) -> nn.Module:
    torch.manual_seed(seed)
    network = build_network((18, 30), len(WELLS), LOCAL, _flow(30, 18))
    network.change.fill_(0.5)
    return network


def _plume(seed: int = 11) -> torch.Tensor:
    field = torch.zeros(4, 18, 30)
    values = np.random.default_rng(seed).uniform(0, 1, (4, 8, 10))
    field[:, 5:13, 10:20] = torch.as_tensor(values, dtype=torch.float32)
    return field


def test_local_network_makes_and_destroys_no_tracer():
    answer = _local()(_plume(), _rates(4)).detach().double()
    assert answer.abs().sum() > 1e-3
    # float32 round-off relative to the sum of sizes
    assert abs(float(answer.sum())) < 1e-6 * float(answer.abs().sum())


@pytest.mark.parametrize('seed', range(5))
def test_local_network_conserves_tracer_and_bounds_in_a_rig_of_uneven_depth(seed):
    network, plume = _local(seed), _plume(seed)
    network.relative_depth.copy_(torch.linspace(0.77, 1.23, 30).expand(18, 30))
    answer = network(plume, _rates(4)).detach()
    moved = answer.double() * network.relative_depth.double()
    assert moved.abs().sum() > 1e-3
    assert abs(float(moved.sum())) < 1e-6 * float(moved.abs().sum())  # float32
    pooled = nn.functional.max_pool2d
    corrected = plume + network.change * answer
    assert bool((corrected <= pooled(plume, 3, 1, 1) + 1e-6).all())
    assert bool((corrected >= -pooled(-plume, 3, 1, 1) - 1e-6).all())


def test_local_network_is_silent_where_there_is_no_tracer():
    answer = _local()(_plume(), _rates(4)).detach()
    away = torch.ones(18, 30, dtype=torch.bool)
    away[4:14, 9:21] = False
    assert float(answer[:, away].abs().max()) == 0.0
    assert float(_local()(torch.zeros(1, 18, 30), _rates(1)).detach().abs().max()) == 0.0


@pytest.mark.parametrize('seed', range(5))
def test_local_correction_makes_no_new_extremum(seed):
    plume, network = _plume(seed), _local(seed)
    corrected = (plume + network.change * network(plume, _rates(4))).detach()
    pooled = nn.functional.max_pool2d
    highest, lowest = pooled(plume, 3, 1, 1), -pooled(-plume, 3, 1, 1)
    tolerance = 1e-6  # float32
    assert bool((corrected <= highest + tolerance).all())
    assert bool((corrected >= lowest - tolerance).all())


def test_local_network_is_the_same_wherever_the_flow_is():
    torch.manual_seed(8)
    network = build_network((40, 40), len(WELLS), LOCAL, _flow(40, 40))
    plume, right, up = torch.zeros(1, 40, 40), torch.rand(1, 40, 39), torch.rand(1, 39, 40)
    plume[:, 16:22, 17:24] = torch.rand(1, 6, 7)
    given = network.change, network.relative_depth
    here = network.source(plume, right, up, *given)
    there = network.source(
        *(torch.roll(field, (2, -3), (1, 2)) for field in (plume, right, up)), *given
    )
    assert float(here.detach().abs().max()) > 1e-3
    assert torch.allclose(there, torch.roll(here, (2, -3), (1, 2)), atol=1e-6)


def test_local_network_is_small_and_needs_the_flow():
    assert parameter_count(_local()) < 10_000
    with pytest.raises(InputError, match='needs the wells'):
        build_network((18, 30), len(WELLS), LOCAL)


def test_unknown_architecture_and_negative_layers_are_refused():
    with pytest.raises(InputError, match='transformer'):
        NetworkSettings(architecture='transformer')
    with pytest.raises(InputError, match='cannot be negative'):
        NetworkSettings(convolution_layers=-1)
