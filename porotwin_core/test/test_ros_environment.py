"""Tests of the variables of ROS 2, and of one graph per domain."""

import os
import shutil
import socket
import subprocess
import sys
from contextlib import ExitStack, nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.ros_environment import (
    LEAST_SHARED_BYTES,
    OWN_PROFILES,
    PROFILES,
    PROGRAMS,
    DomainClaim,
    check_environment,
    check_keys,
    check_room,
    check_shared_memory,
    claim_domain,
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
        (PROFILES, '/none.xml', f'{PROFILES} is /none.xml, which is no file; correct it or unset'),
        (PROFILES, '/', f'{PROFILES} is /, which is no file'),
    ],
)
def test_a_wrong_variable_is_one_line(name: str, value: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint) as error:
        check_environment({name: value})
    assert '\n' not in str(error.value)


def test_a_middleware_that_is_not_installed_is_named_with_those_that_are(tmp_path: Path) -> None:
    (tmp_path / 'lib').mkdir()
    for name in ('cyclonedds_cpp', 'fastrtps_shared_cpp'):
        (tmp_path / 'lib' / f'librmw_{name}.so').touch()
    environ = {'AMENT_PREFIX_PATH': str(tmp_path), 'RMW_IMPLEMENTATION': 'rmw_connext_cpp'}
    with pytest.raises(InputError, match=r'rmw_connext_cpp, which is not installed; .*cyclonedds'):
        check_environment(environ)
    check_environment({**environ, 'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'})


def test_without_a_range_only_this_machine_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', '')
    prepare_environment()
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    prepare_environment()
    assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SUBNET'


def test_the_domain_is_a_number() -> None:
    assert domain_of({'ROS_DOMAIN_ID': ' 7 '}) == 7
    assert domain_of({}) == domain_of({'ROS_DOMAIN_ID': ''}) == 0
    with pytest.raises(InputError, match='from 0 to 232, without zeros before it'):
        domain_of({'ROS_DOMAIN_ID': '010'})  # ROS reads an octal number, 8


def test_a_domain_has_one_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    with claim_domain() as first:
        assert os.environ['ROS_DOMAIN_ID'] == str(first.domain)
        with pytest.raises(InputError, match=f'another graph runs in domain {first.domain} '):
            claim_domain()  # the user's choice is kept
        monkeypatch.delenv('ROS_DOMAIN_ID')
        with claim_domain() as second:
            assert second.domain != first.domain
    with DomainClaim(first.domain) as again:
        assert again.domain == first.domain


@pytest.mark.parametrize('first', [7400, 7410])
def test_a_domain_with_nodes_of_another_program_is_not_chosen(
    first: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    with claim_domain() as free:
        pass
    monkeypatch.delenv('ROS_DOMAIN_ID')
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as node:
        node.bind(('', first + 250 * free.domain))
        with claim_domain() as claim:
            assert claim.domain != free.domain


def test_a_full_shared_memory_is_told_before_ros_crashes_at_it(tmp_path, monkeypatch) -> None:
    check_shared_memory(tmp_path / 'none')
    for free, fits in ((LEAST_SHARED_BYTES, True), (LEAST_SHARED_BYTES - 1, False)):
        usage = SimpleNamespace(free=free)
        monkeypatch.setattr(shutil, 'disk_usage', lambda _, usage=usage: usage)
        with nullcontext() if fits else pytest.raises(InputError, match='MB left, and nodes need'):
            check_shared_memory(tmp_path)


@pytest.mark.graph
def test_a_node_reads_no_messages_from_shared_memory(domain: int) -> None:
    made = "import rclpy; rclpy.init(); node = rclpy.create_node('thing')"
    node = f"{made}; print(open('/proc/self/maps').read())"
    environ = {**os.environ, 'ROS_DOMAIN_ID': str(domain)}
    for profiles, ports in ({PROFILES: str(OWN_PROFILES)}, False), ({PROFILES: ''}, True):
        command = [sys.executable, '-c', node]
        found = subprocess.check_output(command, text=True, env={**environ, **profiles})
        assert ('fastrtps_port' in found) is ports


def test_a_domain_with_more_programs_than_find_each_other_is_full(domain: int) -> None:
    here = {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    with ExitStack() as programs:
        for number in PROGRAMS:
            check_room(here)
            port = programs.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            port.bind(('', 7410 + 250 * domain + 2 * number))
        with pytest.raises(InputError, match=f'ROS_DOMAIN_ID {domain}: 32 programs run'):
            check_room(here)
        check_room({**here, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'})


def test_a_missing_enclave_is_one_line_with_the_command(tmp_path: Path) -> None:
    strict = {
        'ROS_SECURITY_ENABLE': 'true',
        'ROS_SECURITY_STRATEGY': 'Enforce',
        'ROS_SECURITY_KEYSTORE': str(tmp_path),
    }
    words = ['guard_node', '--ros-args', '--enclave', '/porotwin/guard', '-r', '__node:=guard']
    with pytest.raises(InputError, match=r'/porotwin/guard; make them: ros2 security generate'):
        check_keys(strict, words)
    with pytest.raises(InputError, match='not set'):
        check_keys({**strict, 'ROS_SECURITY_KEYSTORE': ''}, words)
    check_keys({**strict, 'ROS_SECURITY_STRATEGY': 'Permissive'}, words)
    (tmp_path / 'enclaves' / 'porotwin' / 'guard').mkdir(parents=True)
    check_keys(strict, words)
