"""Access to the page: names of its host, sites of a request, and the token of the operator.

Everyone who reaches the page may read it, so a screen on the wall needs no token. Confirming rates
needs the token. The token stands behind the # of the address that `./porotwin up` prints. So no
browser sends it to a server by itself, and no other site knows it.

Another site cannot read this page. It could try with a name of its own that points here (DNS
rebinding). Then the header Host names that site, and the request is refused.
"""

import ipaddress
import os
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import read_regular

LOCAL_NAMES = frozenset({'localhost', '127.0.0.1', '::1'})
"""Names of this machine for itself; an SSH tunnel uses them too."""

_ALPHABET = 'abcdefghjkmnpqrstuvwxyz23456789'
"""Letters and digits that are hard to confuse, because people type a token into a phone."""

_GROUPS, _GROUP_LENGTH = 3, 4
"""Groups of a token and their length: 12 of 31 characters are 59 bits, beyond any guessing."""

SHORTEST_TOKEN = 8
"""Shortest token that a file may hold [characters]."""


class AccessRefused(Exception):  # noqa: N818  it is an answer, not a mistake of the program
    """A request is refused; the message is one line with the remedy."""


def new_token() -> str:
    """Return a random token, such as `k7mq-3xwd-p9ra`."""
    groups = (
        ''.join(secrets.choice(_ALPHABET) for _ in range(_GROUP_LENGTH)) for _ in range(_GROUPS)
    )
    return '-'.join(groups)


def token_in(path: Path) -> str:
    """Return the token in the file `path`. A missing file is made, readable by its owner only.

    A restarted node reads the same token, so open pages keep working.

    Raises:
        InputError: the file cannot be read or made, or its token is too short.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        pass
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; name another file for the token') from None
    else:
        with os.fdopen(descriptor, 'w', encoding='ascii') as file:
            file.write(new_token() + '\n')
    try:
        token = read_regular(path).decode('ascii').strip()
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f'{path}: not readable as a token ({error}); remove it') from None
    if len(token) < SHORTEST_TOKEN or not token.isprintable() or ' ' in token:
        raise InputError(
            f'{path}: its token needs {SHORTEST_TOKEN} characters or more in one word; remove it'
        )
    return token


def parse_hosts(text: str) -> frozenset[str]:
    """Return the names in a list such as `rig.example.org, lab-pc`.

    Raises:
        InputError: a name has a scheme, a port or a path.
    """
    names = [name.strip().lower() for name in text.split(',') if name.strip()]
    for name in names:
        if set(name) & set('/:*@ '):
            raise InputError(f"host name '{name}': give names alone, like rig.example.org, lab-pc")
    return frozenset(names)


def host_name(header: str) -> str:
    """Return the name or address in a header Host in lower case, without port and brackets."""
    try:
        return (urlsplit(f'//{header}').hostname or '').rstrip('.')
    except ValueError:
        return ''


@dataclass(frozen=True)
class Access:
    """The rules for requests.

    Attributes:
        token: the token that requests for changes need.
        names: more names of the page's host, beside localhost.
    """

    token: str
    names: frozenset[str] = frozenset()

    def check_host(self, headers: Iterable[str], reached: str) -> None:
        """Check that a request names a host of the page.

        Args:
            headers: all headers Host of the request; there must be one.
            reached: this machine's address of the connection.

        Raises:
            AccessRefused: it names another host, or none.
        """
        given = list(headers)
        name = host_name(given[0]) if len(given) == 1 else ''
        if not name or (
            name not in LOCAL_NAMES | self.names and _plain_address(name) != _plain_address(reached)
        ):
            shown = ', '.join(given)[:80] or 'none'
            raise AccessRefused(
                f'host {shown} is not a name of this page; open it by its address, or start it '
                'with the parameter hosts'
            )

    def check_change(self, origin: str | None, host: str, token: str) -> None:
        """Check that a request may change something.

        Args:
            origin: the header Origin; None if there is none.
            host: the header Host.
            token: the token of the request.

        Raises:
            AccessRefused: another site sent it, or the token is missing or wrong.
        """
        if origin is not None and origin.partition('://')[2].lower() != host.lower():
            raise AccessRefused('confirm from the page itself, not from another site')
        if not token:
            raise AccessRefused(
                'confirming needs the token; open the address that ./porotwin up shows'
            )
        given = token.encode(errors='replace')
        if not secrets.compare_digest(given, self.token.encode()):
            raise AccessRefused('wrong token; open the address that ./porotwin up shows now')


def _plain_address(host: str) -> str:
    """Return an address in its only form, IPv4 within IPv6 as IPv4; a name as it is."""
    try:
        address = ipaddress.ip_address(host.partition('%')[0])
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(address)
