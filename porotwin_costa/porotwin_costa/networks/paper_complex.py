"""The network of the paper with the layers of section 3.2, for a rig with several sands."""

from dataclasses import replace

from porotwin_costa.networks.paper import ARCHITECTURE as PAPER
from porotwin_costa.networks.paper import PaperSettings

ARCHITECTURE = replace(
    PAPER,
    name='paper-complex',
    summary='the network of the paper for a rig with several sands (section 3.2)',
    settings=PaperSettings(convolution_pool_layers=2, convolution_layers=5, dense_layers=5),
)
