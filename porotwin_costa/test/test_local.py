"""The network of fluxes between cells: it conserves tracer and bounds, and depends on no place."""

import dataclasses

import numpy as np
import pytest
import torch
from costa_examples import rig_fields, scaled_rates
from torch import nn

from porotwin_core.basis.errors import InputError
from porotwin_costa.networks import architecture, parameter_count
from porotwin_costa.networks.local import LocalFluxNetwork, LocalFluxSettings


def _local(seed: int = 3, *, nx: int = 30, nz: int = 18, depth=None) -> LocalFluxNetwork:
    torch.manual_seed(seed)
    rig = rig_fields(nx, nz, change=0.5)
    if depth is not None:
        rig = dataclasses.replace(rig, relative_depth=depth)
    return architecture('local').network(rig)


def _plume(seed: int = 11) -> torch.Tensor:
    field = torch.zeros(4, 18, 30)
    values = np.random.default_rng(seed).uniform(0, 1, (4, 8, 10))
    field[:, 5:13, 10:20] = torch.as_tensor(values, dtype=torch.float32)
    return field


def test_local_network_conserves_tracer():
    answer = _local()(_plume(), scaled_rates(4)).detach().double()
    assert answer.abs().sum() > 1e-3
    # float32 round-off relative to the sum of sizes
    assert abs(float(answer.sum())) < 1e-6 * float(answer.abs().sum())


@pytest.mark.parametrize('seed', range(5))
def test_local_network_conserves_tracer_and_bounds_in_a_rig_of_uneven_depth(seed):
    depth = np.linspace(0.77, 1.23, 30) * np.ones((18, 1))
    network, plume = _local(seed, depth=depth), _plume(seed)
    answer = network(plume, scaled_rates(4)).detach()
    moved = answer.double() * network.relative_depth.double()
    assert moved.abs().sum() > 1e-3
    assert abs(float(moved.sum())) < 1e-6 * float(moved.abs().sum())  # float32
    pooled = nn.functional.max_pool2d
    corrected = plume + network.change * answer
    assert bool((corrected <= pooled(plume, 3, 1, 1) + 1e-6).all())
    assert bool((corrected >= -pooled(-plume, 3, 1, 1) - 1e-6).all())


def test_local_network_corrects_nothing_where_there_is_no_tracer():
    answer = _local()(_plume(), scaled_rates(4)).detach()
    away = torch.ones(18, 30, dtype=torch.bool)
    away[4:14, 9:21] = False
    assert float(answer[:, away].abs().max()) == 0.0
    assert float(_local()(torch.zeros(1, 18, 30), scaled_rates(1)).detach().abs().max()) == 0.0


@pytest.mark.parametrize('seed', range(5))
def test_local_correction_makes_no_new_extremum(seed):
    plume, network = _plume(seed), _local(seed)
    corrected = (plume + network.change * network(plume, scaled_rates(4))).detach()
    pooled = nn.functional.max_pool2d
    highest, lowest = pooled(plume, 3, 1, 1), -pooled(-plume, 3, 1, 1)
    tolerance = 1e-6  # float32
    assert bool((corrected <= highest + tolerance).all())
    assert bool((corrected >= lowest - tolerance).all())


def test_local_network_does_not_depend_on_the_place():
    network = _local(8, nx=40, nz=40)
    plume, right, up = torch.zeros(1, 40, 40), torch.rand(1, 40, 39), torch.rand(1, 39, 40)
    plume[:, 16:22, 17:24] = torch.rand(1, 6, 7)
    given = network.change, network.relative_depth
    here = network.source(plume, right, up, *given)
    there = network.source(
        *(torch.roll(field, (2, -3), (1, 2)) for field in (plume, right, up)), *given
    )
    assert float(here.detach().abs().max()) > 1e-3
    assert torch.allclose(there, torch.roll(here, (2, -3), (1, 2)), atol=1e-6)


def test_local_network_is_small():
    assert parameter_count(_local()) < 10_000


def test_weights_of_version_0_1_are_those_of_a_rig_of_even_depth():
    network = _local(depth=np.full((18, 30), 1.1))
    weights = dict(network.state_dict())
    del weights['relative_depth']
    network.load_state_dict(weights)
    assert bool((network.relative_depth == 1.0).all())


def test_a_network_without_filters_is_refused():
    with pytest.raises(InputError, match='at least 1'):
        LocalFluxSettings(filters=0)
