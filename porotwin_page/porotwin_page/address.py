"""The address of the page: HOST:PORT, its listening socket, and the addresses to open."""

import errno
import ipaddress
import re
import socket
from urllib.parse import quote

import psutil

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.ros_environment import LARGEST_PORT

DEFAULT_HOST = '127.0.0.1'
"""Host of an address without one: this machine only."""

EXAMPLE = '127.0.0.1:8765 (this machine only) or 0.0.0.0:8765 (also for phones)'

ALL_INTERFACES = ('0.0.0.0', '::', '0')
"""Hosts that stand for all addresses of this machine."""

_NAME = re.compile(r'[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?')


def parse(address: str) -> tuple[str, int]:
    """Return host and port of an address such as `127.0.0.1:8765` or `[::1]:8765`.

    A port alone, `8765` or `:8765`, is an address of this machine only. Port 0 is any free port.

    Raises:
        InputError: `address` is not of this form.
    """
    text = address.strip()
    host, _, port = text.rpartition(':')
    bracketed = host.startswith('[') and host.endswith(']')
    host = host[1:-1] if bracketed else host or DEFAULT_HOST
    if not (port.isascii() and port.isdecimal()) or int(port) > LARGEST_PORT:
        raise InputError(
            f"page address '{address}': its port must be a number from 0 to {LARGEST_PORT}; "
            f'write HOST:PORT, like {EXAMPLE}'
        )
    if not (_is_ipv6(host) if bracketed else _NAME.fullmatch(host)):
        hint = f'; did you mean [{host}]:{port}?' if _is_ipv6(host) else ''
        raise InputError(
            f"page address '{address}': '{host}' is no name or address of a machine{hint}; "
            f'write HOST:PORT, like {EXAMPLE}'
        )
    return host, int(port)


def _is_ipv6(host: str) -> bool:
    try:
        ipaddress.IPv6Address(host)
    except ValueError:
        return False
    return True


def written(host: str, port: int) -> str:
    """Return host and port as one text; an IPv6 address is in brackets."""
    return f'[{host}]:{port}' if ':' in host else f'{host}:{port}'


def is_local(host: str) -> bool:
    """Return whether `host` is reachable from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == 'localhost'


def listen(address: str) -> socket.socket:
    """Return a socket that listens at `address`.

    The address of all IPv6 interfaces, `[::]`, also takes IPv4.

    Raises:
        InputError: the address is wrong, in use, not allowed, or not one of this machine.
    """
    host, port = parse(address)
    family = socket.AF_INET6 if ':' in host else socket.AF_INET
    both = host == '::' and socket.has_dualstack_ipv6()
    try:
        return socket.create_server((host, port), family=family, dualstack_ipv6=both)
    except OSError as error:
        raise InputError(_refusal(written(host, port), port, error)) from None


def _refusal(address: str, port: int, error: OSError) -> str:
    remedy = '--page HOST:PORT (parameter address)'
    if error.errno == errno.EADDRINUSE:
        return (
            f'page address {address} is in use, perhaps by another page; choose another with '
            f'{remedy}'
        )
    if error.errno == errno.EACCES and port < socket.IPPORT_RESERVED:
        return (
            f'page address {address}: only an administrator may use port {port}; choose one above '
            f'{socket.IPPORT_RESERVED - 1} with {remedy}'
        )
    return (
        f"page address {address}: {error.strerror or error}; choose one of this machine's, like "
        f'{EXAMPLE}, with {remedy}'
    )


def settled(address: str) -> str:
    """Return `address` as host and port after a check that it is free; replace port 0.

    Raises:
        InputError: as `listen`.
    """
    with listen(address) as listening:
        return written(parse(address)[0], listening.getsockname()[1])


def interface_addresses() -> list[str]:
    """Return the IPv4 addresses of this machine's network interfaces, without its own loopback."""
    found = [
        address.address
        for addresses in psutil.net_if_addrs().values()
        for address in addresses
        if address.family == socket.AF_INET
    ]
    return [host for host in dict.fromkeys(found) if not is_local(host)]


def reachable_hosts(host: str) -> list[str]:
    """Return the hosts under which a browser finds a page at `host`.

    A page of all interfaces is found under `127.0.0.1` here, and under every address of this
    machine's interfaces from elsewhere.
    """
    if host not in ALL_INTERFACES:
        return [host]
    return [DEFAULT_HOST, *interface_addresses()]


def page_lines(address: str, token: str) -> list[str]:
    """Return a line for each address that opens the page.

    Args:
        address: HOST:PORT, as `settled` returns it.
        token: the token for confirmations; a browser takes it from the address.
    """
    host, port = parse(address)
    lines = []
    for number, found in enumerate(reachable_hosts(host)):
        title = 'page' if number == 0 else 'page from a phone'
        fragment = quote(token, safe='')  # a token that a person chose may hold & or %
        lines.append(f'{title}: http://{written(found, port)}/#token={fragment}')
    return lines
