"""The network of the paper."""

import pytest
import torch
from costa_examples import rig_fields, scaled_rates
from torch import nn

from porotwin_core.basis.errors import InputError
from porotwin_costa.networks import architecture
from porotwin_costa.networks.paper import PaperSettings

WELLS = 3


def test_layers_are_those_the_paper_describes():
    network = architecture('paper').network(rig_fields(94, 56))
    kinds = [type(layer) for layer in network.convolutions]
    assert kinds == [nn.Conv2d, nn.ReLU, nn.MaxPool2d] * 5
    assert all(layer.out_features == 100 for layer in network.dense)
    assert len(network.dense) == 3


def test_layers_for_several_sands_are_those_the_paper_describes():
    network = architecture('paper-complex').network(rig_fields(94, 56))
    kinds = [type(layer) for layer in network.convolutions]
    assert kinds.count(nn.MaxPool2d) == 2
    assert kinds.count(nn.Conv2d) == 7
    assert len(network.dense) == 5


def test_every_dense_layer_reads_the_rates():
    network = architecture('paper-complex').network(rig_fields(30, 20))
    assert [layer.in_features for layer in network.dense[1:]] == [100 + 2 * WELLS] * 4


def test_last_row_and_column_of_an_odd_grid_matter():
    torch.manual_seed(5)
    network = architecture('paper').network(rig_fields(19, 11))
    blank = torch.zeros(1, 11, 19)
    corner = blank.clone()
    corner[0, -1, -1] = 5.0
    assert not torch.equal(network(blank, scaled_rates(1)), network(corner, scaled_rates(1)))


@pytest.mark.parametrize('wrong', [{'convolution_layers': -1}, {'dense_layers': 0}, {'filters': 0}])
def test_impossible_layers_are_refused(wrong):
    with pytest.raises(InputError, match='cannot be negative'):
        PaperSettings(**wrong)
