"""Settings of all tests: repeatable property tests, and a DDS domain for every test file."""

import fcntl
import gc
import itertools
import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TextIO

import pytest
from hypothesis import settings

from porotwin_core.ros.ros_environment import has_nodes, leave_shared_memory

for _threads in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'):
    # workers of xdist and nodes share the cores; threads of small products only wait for each other
    os.environ.setdefault(_threads, '1')

settings.register_profile('porotwin', deadline=None, derandomize=True)
settings.load_profile('porotwin')

DOMAINS = range(1, 81)
"""DDS domains of the tests; a demo chooses among larger ones (`ros_environment.py`)."""

FILES_WITH_NODES = pytest.StashKey[set[Path]]()

WHOLE_PROJECT = Path(__file__).parent / 'tests'
"""Folder of the tests that run documents, examples and whole graphs."""


def _own_domains() -> Sequence[int]:
    """Return the domains of this worker of xdist, or all of them without xdist.

    Nodes of a test that has ended live until Python collects their context. A test of another
    worker that took their domain at once would meet them.
    """
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    return DOMAINS[worker :: int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))]


_claims: dict[int, TextIO] = {}
_next = itertools.cycle(_own_domains())
"""Goes on behind the last domain, so that a domain rests after a test."""


def _claimed_domain() -> int:
    """Return a DDS domain without nodes; keep it from other tests on this machine until `_release`.

    A busy machine may still run nodes of a test that has ended.
    """
    for number in itertools.islice(_next, len(_own_domains())):
        if has_nodes(number):
            continue
        claim = (Path(tempfile.gettempdir()) / f'porotwin_test_domain_{number}').open('w')
        try:
            fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            claim.close()
            continue
        _claims[number] = claim
        return number
    raise RuntimeError(f'nodes or tests use all DDS domains of this worker, {list(_own_domains())}')


def _release(number: int, *, nodes: bool = True) -> None:
    """Let other tests have a domain. Nodes in this process leave it when Python collects them."""
    if nodes:
        gc.collect()
    _claims.pop(number).close()


def pytest_configure() -> None:
    """Separate the nodes of these tests from a rig's nodes and from other tests.

    A shell lets its background jobs ignore Ctrl-C, and all processes that they start. Tests press
    Ctrl-C, so it counts here.

    Python collects no garbage while pytest collects the tests: what imports make stays.
    """
    gc.disable()
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ['ROS_DOMAIN_ID'] = str(_claimed_domain())
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    leave_shared_memory()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put long files first, those of the whole project above all.

    At the end all workers have short files left.
    """
    long = {
        item.path
        for item in items
        if item.get_closest_marker('slow') is not None
        or (item.get_closest_marker('graph') is not None and WHOLE_PROJECT in item.path.parents)
    }
    items.sort(key=lambda item: (item.path not in long, WHOLE_PROJECT not in item.path.parents))


def pytest_collection_finish(session: pytest.Session) -> None:
    """Note the files with nodes, and keep what the imports made from garbage collections."""
    session.stash[FILES_WITH_NODES] = {
        item.path for item in session.items if item.get_closest_marker('graph') is not None
    }
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True, scope='module')
def _domain_of_the_file(request: pytest.FixtureRequest) -> Iterator[None]:
    """Give each test file a DDS domain: what one leaves behind is not met by the next.

    A collection costs a tenth of a second, so a file whose tests start no nodes has none.
    """
    before, number = os.environ['ROS_DOMAIN_ID'], _claimed_domain()
    os.environ['ROS_DOMAIN_ID'] = str(number)
    yield
    os.environ['ROS_DOMAIN_ID'] = before
    _release(number, nodes=request.path in request.session.stash[FILES_WITH_NODES])


@pytest.fixture(scope='session')
def new_domain() -> Callable[[], int]:
    """Makes DDS domains for fixtures that outlive a test."""
    return _claimed_domain


@pytest.fixture
def domain() -> Iterator[int]:
    """A DDS domain of its own, free of nodes of earlier tests."""
    number = _claimed_domain()
    yield number
    _release(number)
