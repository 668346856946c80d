"""All architectures by name, collected from the modules of this folder."""

from porotwin_core.basis.discovery import discovered
from porotwin_core.basis.errors import InputError
from porotwin_costa.networks.corrective_network import Architecture

DEFAULT = 'hybrid'
"""Trained when nobody chooses: it has the smallest error of free runs, see docs/costa.md."""


ARCHITECTURES = discovered(
    __package__,
    'ARCHITECTURE',
    Architecture,
    'docs/extend/network.md',
    helpers=('corrective_network', 'network_registry', 'training_settings'),
)
"""Every architecture by its name, in the order of the module names."""


def architecture(name: str = '') -> Architecture:
    """Return the architecture called `name`; the default one for an empty name.

    Raises:
        InputError: the name is unknown; the message lists the known ones.
    """
    name = name or DEFAULT
    if name not in ARCHITECTURES:
        raise InputError(f"architecture '{name}': unknown; choose from {', '.join(ARCHITECTURES)}")
    return ARCHITECTURES[name]
