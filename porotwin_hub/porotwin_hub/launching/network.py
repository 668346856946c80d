"""The section `network` of a parameter file: how nodes find each other over machines.

```yaml
network:
  namespace: rig2
  domain: 7
  peers: [camera-pc, 192.168.1.7]            # the other machines; nothing is sent by multicast
  discovery_server: 192.168.1.5:11811        # instead of peers: one process knows all nodes
```

The rmw of Fast DDS reads environment variables (https://docs.ros.org/en/jazzy, "Improved Dynamic
Discovery"; https://fast-dds.docs.eprosima.com, "Discovery Server Settings").
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.likely_name import did_you_mean
from porotwin_core.ros.ros_environment import (
    DOMAIN,
    LARGEST_PORT,
    PEERS,
    RANGE,
    domain_of,
    namespace_of,
)
from porotwin_hub.launching.parameter_file import NETWORK, read_parameter_file

SERVER = 'ROS_DISCOVERY_SERVER'
WHOLE_GRAPH = 'ROS_SUPER_CLIENT'
"""A node that must see the whole graph; the checks of senders need it."""


@dataclass(frozen=True)
class Network:
    """How the nodes of one rig find each other.

    Attributes:
        namespace: namespace of the nodes; empty: the default.
        domain: DDS domain; None: the one of the environment.
        peers: names or addresses of the other machines.
        discovery_server: HOST:PORT of a discovery server; empty: none.
    """

    namespace: str = ''
    domain: int | None = None
    peers: tuple[str, ...] = ()
    discovery_server: str = ''

    def environment(self) -> dict[str, str]:
        """Return the variables of ROS 2 and Fast DDS for the nodes."""
        found = {}
        if self.domain is not None:
            found[DOMAIN] = str(self.domain)
        if self.peers:
            # without multicast only this machine and the peers are asked
            found[RANGE], found[PEERS] = 'LOCALHOST', ';'.join(self.peers)
        if self.discovery_server:
            found[RANGE] = 'SUBNET'
            found[SERVER], found[WHOLE_GRAPH] = self.discovery_server, 'TRUE'
        return found


def parsed_network(content: Any) -> Network:
    """Return the section `network`, as YAML gives it.

    Raises:
        InputError: a key is unknown, or a value is wrong.
    """
    if not isinstance(content, Mapping):
        raise InputError(f"'{NETWORK}' is no section; write KEY: VALUE below it")
    known = [each.name for each in fields(Network)]
    for key in content:
        if key not in known:
            hint = did_you_mean(key, known) or f'known: {", ".join(known)}'
            raise InputError(f"{NETWORK}: unknown key '{key}'; {hint}")
    peers = content.get('peers') or []
    if not isinstance(peers, list) or not all(isinstance(peer, str) for peer in peers):
        raise InputError(f'{NETWORK}: peers needs a list, such as [camera-pc, 192.168.1.7]')
    server = str(content.get('discovery_server') or '')
    if server and peers:
        raise InputError(f'{NETWORK}: give peers or a discovery_server, not both')
    if server:
        _check_server(server)
    domain, namespace = content.get('domain'), content.get('namespace')
    return Network(
        '' if namespace is None else namespace_of(str(namespace)),
        None if domain is None else domain_of({DOMAIN: str(domain)}),
        tuple(peers),
        server,
    )


def _check_server(text: str) -> None:
    host, _, port = text.rpartition(':')
    if not host or not port.isdecimal() or not 0 < int(port) <= LARGEST_PORT:
        raise InputError(
            f"{NETWORK}: discovery_server is '{text}'; write HOST:PORT, such as 192.168.1.5:11811"
        )


def network_of(path: Path | None) -> Network:
    """Return the section `network` of a parameter file; the default where there is none.

    Raises:
        InputError: the file cannot be read, or the section is wrong.
    """
    if path is None:
        return Network()
    content = read_parameter_file(path)
    try:
        return parsed_network(content[NETWORK]) if NETWORK in (content or {}) else Network()
    except InputError as error:
        raise InputError(f'{path}: {error}') from None
