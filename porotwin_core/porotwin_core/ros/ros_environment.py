"""The environment variables of ROS 2, checked before a node starts, and one graph per domain.

ROS aborts deep in a library at a wrong value, or ignores the value.
"""

import errno
import os
import re
import shutil
import socket
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Self

from porotwin_core.basis.errors import InputError

DOMAIN = 'ROS_DOMAIN_ID'
RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
MIDDLEWARE = 'RMW_IMPLEMENTATION'
PEERS = 'ROS_STATIC_PEERS'
SECURITY = 'ROS_SECURITY_ENABLE'
STRATEGY = 'ROS_SECURITY_STRATEGY'
KEYSTORE = 'ROS_SECURITY_KEYSTORE'
ENCLAVE = 'ROS_SECURITY_ENCLAVE_OVERRIDE'

NAMESPACE_NAME = re.compile(r'(/[A-Za-z][A-Za-z0-9_]*)+')

LARGEST_DOMAIN = 232
"""Largest domain: its ports end below 65536 (design.ros2.org, about domain IDs)."""

FREE_DOMAINS = range(81, 102)
"""Domains to choose from.

Their ports lie below those that Linux gives to programs (docs.ros.org). People set small numbers by
hand, and the tests of this project use those up to 80.
"""

CONSOLE_FORMAT = 'RCUTILS_CONSOLE_OUTPUT_FORMAT'
READABLE_LINES = '[{severity}] {date_time_with_ms} {name}: {message}'
"""The lines of a node: a date instead of seconds since 1970 (docs.ros.org, about logging)."""

LARGEST_PORT = 65535
"""Largest port of TCP and UDP."""

DOMAIN_PORTS = 250
"""Ports of one domain (RTPS 2.2, section 9.6.1)."""

FIRST_PORTS = (7400, 7410)
"""Ports that the first node of domain 0 opens: for all nodes, and its own (RTPS 2.2, 9.6.1)."""

PROGRAMS = range(32)
"""Numbers of the programs of a domain on one machine. With `LOCALHOST` every program calls these,
so that two with greater numbers never find each other (measured with Fast DDS of ROS 2 Jazzy)."""

SHARED_MEMORY = Path('/dev/shm')
"""Folder of the messages between the nodes of a machine."""

LEAST_SHARED_BYTES = 16 << 20
"""Free space in it that a graph needs [B]: 0.7 MB for each of 16 nodes."""

PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'
OWN_PROFILES = Path(__file__).with_name('fast_dds.xml')
"""Has messages sent through the network of the machine, and not through its shared memory.

Fast DDS watches only those readers of shared memory that wait. If a process is killed or stopped
while it reads, the others go on writing where nobody reads, and the one that starts in its place
gets no message and learns no name of a node. A photograph of 12 MB takes 0.1 s longer so.
"""

RANGES = ('LOCALHOST', 'SUBNET', 'SYSTEM_DEFAULT')
"""The nodes of a graph find each other in these discovery ranges."""


def prepare_environment() -> None:
    """Check the variables of ROS 2, and set those that are not set.

    Nodes find those of this machine only, and their lines have a readable date.

    Raises:
        InputError: one line with the variable and its allowed values, or the shared memory is full.
    """
    check_environment(os.environ)
    check_shared_memory()
    if not os.environ.get(RANGE):
        os.environ[RANGE] = 'LOCALHOST'
    os.environ.setdefault(CONSOLE_FORMAT, READABLE_LINES)
    leave_shared_memory()


def leave_shared_memory() -> None:
    """Have Fast DDS send through the network of the machine, unless the user has own profiles."""
    os.environ.setdefault(PROFILES, str(OWN_PROFILES))


def check_environment(environ: Mapping[str, str]) -> None:
    """Check the variables of ROS 2 in `environ`.

    Raises:
        InputError: one line with the variable and its allowed values.
    """
    domain_of(environ)
    found = environ.get(RANGE)
    if found and found not in RANGES:
        why = 'the nodes cannot find each other' if found == 'OFF' else 'no such range'
        raise InputError(f'{RANGE} is {found}: {why}; set it to one of {", ".join(RANGES)}')
    _check_middleware(environ)
    _check_profiles(environ)
    _check_peers(environ.get(PEERS, ''))


def check_keys(environ: Mapping[str, str], arguments: Sequence[str]) -> None:
    """Check that a node which must be protected has keys. ROS ends it with a traceback otherwise.

    Args:
        environ: the environment variables.
        arguments: the arguments of the program; the word after --enclave names its enclave.

    Raises:
        InputError: the keystore lacks the enclave; the line has the command that makes it.
    """
    if environ.get(SECURITY) != 'true' or environ.get(STRATEGY) != 'Enforce':
        return
    _, _, given = ' '.join(arguments).partition('--enclave ')
    enclave = environ.get(ENCLAVE) or (given.split() or ['/'])[0]
    store = environ.get(KEYSTORE, '')
    folder = Path(store, 'enclaves', enclave.strip('/'))
    if not store or not folder.is_dir():
        raise InputError(
            f'{KEYSTORE}: {folder if store else "not set"}: no keys for the enclave {enclave}; '
            f'make them: ros2 security generate_artifacts -k {store or "keystore"} '
            '-p porotwin_guard/config/porotwin.policy.xml (docs/security.md)'
        )


def check_shared_memory(folder: Path = SHARED_MEMORY) -> None:
    """Check the free space in the `folder` of the shared memory. ROS crashes in a full one.

    Raises:
        InputError: a graph does not fit.
    """
    with suppress(FileNotFoundError):  # ROS does without
        free = shutil.disk_usage(folder).free
        if free < LEAST_SHARED_BYTES:
            raise InputError(
                f'{folder}: has {free / 1e6:.1f} MB left, and nodes need '
                f'{LEAST_SHARED_BYTES / 1e6:.0f} MB; remove old files there, or give it '
                'more (docker run --shm-size)'
            )


def check_room(environ: Mapping[str, str]) -> None:
    """Check that one more node in the domain of `environ` will be found.

    Raises:
        InputError: the domain is full.
    """
    domain = domain_of(environ)
    if environ.get(RANGE) == 'LOCALHOST' and all(map(_is_taken, _own_ports(domain))):
        raise InputError(
            f'{DOMAIN} {domain}: {len(PROGRAMS)} programs run in this domain on this machine, and '
            'no more find each other; end some, or give the twin a domain of its own (--domain)'
        )


def domain_of(environ: Mapping[str, str]) -> int:
    """Return the domain from the environment variables; 0 by default.

    Raises:
        InputError: it is no number from 0 to 232, or begins with a zero: ROS takes 010 as 8.
    """
    text = environ.get(DOMAIN, '').strip() or '0'
    is_number = text.isascii() and text.isdigit() and int(text) <= LARGEST_DOMAIN
    if not is_number or text != str(int(text)):
        zeros = ', without zeros before it' if is_number else ''
        raise InputError(
            f'{DOMAIN} is {text}; set it to a number from 0 to {LARGEST_DOMAIN}{zeros}'
        )
    return int(text)


def _check_middleware(environ: Mapping[str, str]) -> None:
    name = environ.get(MIDDLEWARE, '')
    prefixes = [sys.prefix, *environ.get('AMENT_PREFIX_PATH', '').split(':')]
    folders = [Path(prefix, 'lib') for prefix in filter(None, prefixes)]
    folders += [Path(path) for path in environ.get('LD_LIBRARY_PATH', '').split(':') if path]
    libraries = {path.stem for folder in folders for path in folder.glob('librmw_*_cpp.so')}
    installed = sorted(library.removeprefix('lib') for library in libraries)
    known = [each for each in installed if not each.endswith('_shared_cpp') and '__' not in each]
    if name and known and name not in known:
        raise InputError(
            f'{MIDDLEWARE} is {name}, which is not installed; unset it or set it to one of '
            f'{", ".join(known)}'
        )


def _check_profiles(environ: Mapping[str, str]) -> None:
    """Refuse profiles that are no file: Fast DDS would send through shared memory again."""
    found, middleware = environ.get(PROFILES), environ.get(MIDDLEWARE) or 'rmw_fastrtps_cpp'
    if found and 'fastrtps' in middleware and not Path(found).is_file():
        raise InputError(f'{PROFILES} is {found}, which is no file; correct it or unset it')


def _check_peers(text: str) -> None:
    for peer in filter(None, text.split(';')):
        try:
            socket.getaddrinfo(peer, None)
        except (OSError, UnicodeError):
            raise InputError(
                f"{PEERS} names '{peer}', a host that is not known; give names or addresses, "
                'separated by ;'
            ) from None


def namespace_of(text: str) -> str:
    """Return a namespace of nodes with a slash before it, such as /rig2.

    Raises:
        InputError: `text` is no name of ROS.
    """
    name = f'/{text.strip().strip("/")}'
    if not NAMESPACE_NAME.fullmatch(name):
        raise InputError(
            f"namespace '{text}': write letters, digits and underscores, a letter first, such as "
            'rig2'
        )
    return name


def enter_domain(domain: int | None) -> None:
    """Set the domain of this process and its children to `domain`; None: change nothing.

    Raises:
        InputError: it is no number from 0 to 232.
    """
    if domain is not None:
        os.environ[DOMAIN] = str(domain_of({DOMAIN: str(domain)}))


class DomainClaim:
    """Keeps a domain for one graph on this machine; a context manager.

    The domain is free again when the process ends. This class does not see graphs on other
    machines; a second hub refuses to start there.
    """

    def __init__(self, domain: int) -> None:
        """Claim `domain`.

        Raises:
            InputError: a graph on this machine has claimed it.
        """
        self.domain = domain
        self._lock = _lock(domain)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Give the domain back."""
        self._lock.close()


def _lock(domain: int) -> socket.socket:
    """Return the lock of a domain: a name in Linux's abstract sockets.

    It needs no file, so that graphs with other folders for temporary files see it as well.
    """
    lock = socket.socket(socket.AF_UNIX)
    try:
        lock.bind(f'\0porotwin_domain_{domain}')
    except OSError as error:
        lock.close()
        if error.errno != errno.EADDRINUSE:
            raise
        raise InputError(
            f'another graph runs in domain {domain} on this machine, and both would act on the '
            f'same pumps; end it, or for another rig set {DOMAIN} to another number (--domain)'
        ) from None
    return lock


def claim_domain() -> DomainClaim:
    """Claim the domain of `ROS_DOMAIN_ID`; if there is none, choose one without nodes and set it.

    Raises:
        InputError: the domain is in use, or no domain is free.
    """
    if os.environ.get(DOMAIN, '').strip():
        return DomainClaim(domain_of(os.environ))
    for domain in FREE_DOMAINS:
        if has_nodes(domain):
            continue
        try:
            claim = DomainClaim(domain)
        except InputError:
            continue
        os.environ[DOMAIN] = str(domain)
        return claim
    raise InputError(f'all domains up to {FREE_DOMAINS[-1]} are in use; end some graphs')


def has_nodes(domain: int) -> bool:
    """Return whether nodes run in `domain` on this machine, also those of other programs."""
    shared = FIRST_PORTS[0] + DOMAIN_PORTS * domain
    return any(map(_is_taken, (shared, *_own_ports(domain))))


def _own_ports(domain: int) -> list[int]:
    """Return the ports that the `PROGRAMS` of a domain open for themselves."""
    first = FIRST_PORTS[-1] + DOMAIN_PORTS * domain
    return [first + 2 * number for number in PROGRAMS]


def _is_taken(number: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        try:
            port.bind(('', number))
        except OSError:
            return True
    return False
