"""The graph over two machines without multicast: what a cut cable does to the photographs."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from two_hosts import PROFILES, Hosts, figures

pytestmark = pytest.mark.graph

CUT_S = 3.0


@pytest.fixture
def hosts() -> Iterator[Hosts]:
    made = Hosts(f'porotwin{os.getpid()}')
    if reason := made.make():
        pytest.skip(reason)
    yield made
    made.remove()


@pytest.mark.parametrize('profile', PROFILES)
def test_photographs_come_again_after_the_cable_was_cut(
    hosts: Hosts, profile: str, tmp_path: Path
) -> None:
    found = figures(hosts, PROFILES[profile], tmp_path, CUT_S)
    assert found['lost_before_the_cut'] == 0
    assert found['lost_in_the_cut'] <= 10 * CUT_S + 5  # a queue of photographs bridges a part of it
