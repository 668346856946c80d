"""Tests of the variables of ROS 2, and of one graph per domain."""

import tempfile
from pathlib import Path

import pytest

from porotwin_core.errors import InputError
from porotwin_core.ros_environment import (
    DomainClaim,
    claim_free_domain,
    domain_of,
    prepare_environment,
)


@pytest.mark.parametrize(
    ('name', 'value', 'complaint'),
    [
        ('ROS_DOMAIN_ID', '233', 'ROS_DOMAIN_ID is 233; set it to a number from 0 to 232'),
        ('ROS_DOMAIN_ID', '-1', 'ROS_DOMAIN_ID is -1'),
        ('ROS_DOMAIN_ID', 'lab', 'ROS_DOMAIN_ID is lab'),
        ('ROS_DOMAIN_ID', '1e2', 'ROS_DOMAIN_ID is 1e2'),
        ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'WORLD', 'is WORLD: no such range; set it to one of'),
        ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF', 'is OFF: the nodes cannot find each other'),
        ('ROS_STATIC_PEERS', '10.0.0.1;no host', "names 'no host', a host that is not known"),
    ],
)
def test_a_wrong_variable_is_one_line(name: str, value: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as error:
        prepare_environment({name: value})
    assert '\n' not in str(error.value)


def test_a_middleware_that_is_not_installed_is_named_with_those_that_are(tmp_path: Path) -> None:
    (tmp_path / 'lib').mkdir()
    for name in ('cyclonedds_cpp', 'fastrtps_shared_cpp'):
        (tmp_path / 'lib' / f'librmw_{name}.so').touch()
    environ = {'AMENT_PREFIX_PATH': str(tmp_path), 'RMW_IMPLEMENTATION': 'rmw_connext_cpp'}
    with pytest.raises(InputError, match=r'rmw_connext_cpp, which is not installed; .*cyclonedds'):
        prepare_environment(environ)
    prepare_environment({**environ, 'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'})


def test_without_a_range_only_this_machine_is_searched() -> None:
    environ: dict[str, str] = {'ROS_DOMAIN_ID': ' 7 '}
    prepare_environment(environ)
    assert environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'SUBNET'
    prepare_environment(environ)
    assert environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SUBNET'
    assert domain_of(environ) == 7
    assert domain_of({}) == domain_of({'ROS_DOMAIN_ID': ''}) == 0


def test_a_domain_has_one_graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    first = DomainClaim(1)
    with pytest.raises(InputError, match=r'another graph runs in domain 1 .*set ROS_DOMAIN_ID to'):
        DomainClaim(1)
    second = claim_free_domain()
    assert second.domain == 2
    first.release()
    third = claim_free_domain()
    assert third.domain == 1
    second.release()
    third.release()
