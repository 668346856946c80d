"""The networks that COSTA can train: one module for each.

A module of this folder that defines `ARCHITECTURE` is found by itself. Its name is then a choice of
`./porotwin train --architecture` and of the parameter `architecture` of the nodes.
"""

from porotwin_costa.networks.corrective_network import (
    Architecture,
    CorrectiveNetwork,
    RigFields,
    Window,
    parameter_count,
)
from porotwin_costa.networks.network_registry import ARCHITECTURES, DEFAULT, architecture

__all__ = [
    'ARCHITECTURES',
    'DEFAULT',
    'Architecture',
    'CorrectiveNetwork',
    'RigFields',
    'Window',
    'architecture',
    'parameter_count',
]
