"""The rigs to choose from: the pages on this machine, and those that a parameter names.

Every page keeps an abstract socket of Linux with its namespace, domain, host and port in the name.
It needs no file, and it disappears with the process, however that ends.
"""

import socket
from dataclasses import dataclass
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_page.address import ALL_INTERFACES, written

SOCKETS = Path('/proc/net/unix')
"""All sockets of this machine by name; an abstract name begins with @."""

MARK = 'porotwin_page|'
"""Begin of the names of these sockets."""

LONGEST_NAME = 107
"""Longest name of a socket on Linux [characters]."""


@dataclass(frozen=True)
class RigPage:
    """A page: the namespace of its rig, and where it is.

    `host` is empty if the page is found under every address of this machine.
    """

    name: str
    host: str
    port: int
    own: bool = False


def announce(namespace: str, domain: int, host: str, port: int) -> socket.socket:
    """Make a page known on this machine as long as the returned socket is open."""
    everywhere = '' if host in ALL_INTERFACES else host
    name = f'{MARK}{port}|{domain}|{everywhere}|{namespace.strip("/")}'[:LONGEST_NAME]
    announced = socket.socket(socket.AF_UNIX)
    announced.bind(f'\0{name}')
    return announced


def pages_here(text: str) -> list[RigPage]:
    """Return the pages on this machine, by name.

    Args:
        text: the content of `SOCKETS`.
    """
    found = set()
    for line in text.splitlines():
        _, mark, rest = line.partition(f'@{MARK}')
        parts = rest.split('|', 3)
        if mark and len(parts) == 4 and parts[0].isdecimal():
            port, domain, host, namespace = parts
            found.add(RigPage(f'{namespace} (domain {domain})', host, int(port)))
    return sorted(found, key=lambda page: (page.name, page.port))


def named_pages(text: str) -> dict[str, str]:
    """Return addresses by name, from a text such as `west=http://lab2:8765, east=...`.

    Raises:
        InputError: a part of the text has another form.
    """
    found = {}
    for part in filter(None, (part.strip() for part in text.split(','))):
        name, _, address = part.partition('=')
        if not name.strip() or not address.strip().startswith(('http://', 'https://')):
            raise InputError(
                f"parameter 'rigs' of page: '{part}'; write NAME=http://HOST:PORT, with commas "
                'between several'
            )
        found[name.strip()] = address.strip()
    return found


class RigList:
    """The rigs that a page offers: itself, others on this machine, and named ones elsewhere."""

    def __init__(self, port: int, named: dict[str, str]) -> None:
        """Offer the `named` rigs; `port` is that of this page."""
        self._port = port
        self._named = named

    def offered(self, reached_host: str) -> list[dict[str, object]]:
        """Return name and address of every rig.

        Args:
            reached_host: the host under which the browser reached this page. Pages that only this
                machine reaches are offered to browsers on this machine.
        """
        try:
            here = pages_here(SOCKETS.read_text(encoding='utf-8', errors='replace'))
        except OSError:  # no Linux, or no rights
            here = []
        rigs: list[dict[str, object]] = [
            {
                'name': page.name,
                'address': f'http://{written(reached_host, page.port)}/',
                'own': page.port == self._port,
            }
            for page in here
            if page.host in ('', reached_host)
        ]
        elsewhere = self._named.items()
        return rigs + [{'name': name, 'address': at, 'own': False} for name, at in elsewhere]


NO_RIGS = RigList(0, {})
"""No rig is named."""
