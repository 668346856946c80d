"""All camera sources by name, and the source that an address names."""

import re

from porotwin_core.basis.discovery import discovered
from porotwin_core.basis.errors import InputError
from porotwin_imaging.sources.camera_source import SourceKind

DEFAULT_SOURCE = 'device'
"""The source of an address without a name, such as /dev/video0."""
WEB_SOURCE = 'snapshot'
"""The source of an address that begins with http:// or https://."""
_NAMED_ADDRESS = re.compile(r'(?P<name>[a-z][a-z0-9_]*):(?!//)(?P<address>.*)', re.DOTALL)
"""NAME:ADDRESS; a URL such as rtsp://camera is an address without a name."""

SOURCES: dict[str, SourceKind] = discovered(
    __package__,
    'SOURCE',
    SourceKind,
    'docs/extend/source.md',
    helpers=('baseline_choice', 'camera_source', 'photo_protocol', 'source_registry'),
)
"""All camera sources by name, in alphabetical order."""


def source_at(text: str) -> tuple[SourceKind, str]:
    """Return the source and the address that `text` names, NAME:ADDRESS or an address alone.

    Raises:
        InputError: there is no source of this name, or no text.
    """
    named = _NAMED_ADDRESS.fullmatch(text)
    if named is None:
        if not text.strip():
            raise InputError(f'no camera source; give one of {described_sources()}')
        is_web = text.startswith(('http://', 'https://'))
        return SOURCES[WEB_SOURCE if is_web else DEFAULT_SOURCE], text
    if named['name'] not in SOURCES:
        raise InputError(
            f"no camera source is named '{named['name']}'; give one of {described_sources()}"
        )
    if not named['address']:
        raise InputError(f"no camera source is '{text}' alone; give one of {described_sources()}")
    return SOURCES[named['name']], named['address']


def check_source(text: str) -> None:
    """Check a camera source before nodes start.

    Args:
        text: NAME:ADDRESS, or an address alone.

    Raises:
        InputError: there is no such source, its address is wrong, or no camera is there.
    """
    kind, address = source_at(text)
    kind.check(address)


def described_sources() -> str:
    """Return all sources with the meaning of their addresses, for messages."""
    return ', '.join(f'{kind.name}:({kind.address})' for kind in SOURCES.values())
