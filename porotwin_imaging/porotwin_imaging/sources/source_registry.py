"""The registry of camera sources: finds every module in this folder that defines `SOURCE`."""

import importlib
import pkgutil
import re
from functools import cache

from porotwin_core.errors import InputError
from porotwin_imaging import sources
from porotwin_imaging.sources.camera_source import SourceKind

DEFAULT_SOURCE = 'device'
"""The source of an address without a name, such as /dev/video0."""
_NAMED_ADDRESS = re.compile(r'(?P<name>[a-z][a-z0-9_]*):(?!//)(?P<address>.+)', re.DOTALL)
"""NAME:ADDRESS; a URL such as rtsp://camera is an address without a name."""


@cache
def source_kinds() -> dict[str, SourceKind]:
    """Return all sources by name, in alphabetical order.

    Raises:
        ValueError: two modules announce the same name.
    """
    kinds: dict[str, SourceKind] = {}
    for module in pkgutil.iter_modules(sources.__path__, sources.__name__ + '.'):
        kind = getattr(importlib.import_module(module.name), 'SOURCE', None)
        if kind is None:
            continue
        if kind.name in kinds:
            raise ValueError(f"two camera sources are named '{kind.name}'")
        kinds[kind.name] = kind
    return dict(sorted(kinds.items()))


def source_at(text: str) -> tuple[SourceKind, str]:
    """Return the source and the address that `text` names, NAME:ADDRESS or an address alone.

    Raises:
        InputError: there is no source of this name, or no text.
    """
    kinds = source_kinds()
    named = _NAMED_ADDRESS.fullmatch(text)
    if named is None:
        if not text:
            raise InputError(f'no camera source; give one of {described_sources()}')
        return kinds[DEFAULT_SOURCE], text
    if named['name'] not in kinds:
        raise InputError(
            f"no camera source is named '{named['name']}'; give one of {described_sources()}"
        )
    return kinds[named['name']], named['address']


def described_sources() -> str:
    """Return all sources with the meaning of their addresses, for messages."""
    return ', '.join(f'{kind.name}:({kind.address})' for kind in source_kinds().values())
