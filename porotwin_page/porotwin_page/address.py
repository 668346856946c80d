"""The address HOST:PORT of the page, and its listening socket."""

import errno
import ipaddress
import socket

from porotwin_core.errors import InputError

MAX_PORT = 65535
"""Largest TCP port."""


def parse(address: str) -> tuple[str, int]:
    """Return host and port of an address such as `127.0.0.1:8765` or `[::1]:8765`.

    Port 0 selects any free port.

    Raises:
        InputError: `address` is not of this form.
    """
    host, _, port = address.rpartition(':')
    host = host.removeprefix('[').removesuffix(']')
    if not host or not port.isdecimal() or int(port) > MAX_PORT:
        raise InputError(f"page address '{address}': write HOST:PORT, like 127.0.0.1:8765")
    return host, int(port)


def is_local(host: str) -> bool:
    """Return whether `host` is reachable from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == 'localhost'


def listen(address: str) -> socket.socket:
    """Return a socket that listens at `address`.

    Raises:
        InputError: the port is in use, or the host does not belong to this machine.
    """
    host, port = parse(address)
    family = socket.AF_INET6 if ':' in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise InputError(
                f'page address {address} is in use, perhaps by another page; choose another with '
                '--page HOST:PORT (parameter address)'
            ) from None
        raise InputError(
            f"page address {address}: {error.strerror or error}; choose one of this machine's with "
            '--page HOST:PORT (parameter address)'
        ) from None
