"""All architectures by name, collected from the modules of this folder."""

import importlib
import pkgutil
from pathlib import Path

from porotwin_core.errors import InputError
from porotwin_costa.networks.corrective_network import Architecture

DEFAULT = 'paper'
"""Trained when nobody chooses: the network that the paper describes."""


def _found() -> dict[str, Architecture]:
    architectures: dict[str, Architecture] = {}
    for module in pkgutil.iter_modules([str(Path(__file__).parent)]):
        found = importlib.import_module(f'{__package__}.{module.name}').__dict__.get('ARCHITECTURE')
        if isinstance(found, Architecture):
            if found.name in architectures:
                raise ValueError(f"two modules of {__package__} define '{found.name}'")
            architectures[found.name] = found
    return architectures


def architecture(name: str = '') -> Architecture:
    """Return the architecture called `name`; the default one for an empty name.

    Raises:
        InputError: the name is unknown; the message lists the known ones.
    """
    name = name or DEFAULT
    if name not in ARCHITECTURES:
        raise InputError(f"architecture '{name}': unknown; choose from {', '.join(ARCHITECTURES)}")
    return ARCHITECTURES[name]


ARCHITECTURES = _found()
"""Every architecture by its name, in the order of the module names."""
