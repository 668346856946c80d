"""Tests of the address HOST:PORT."""

import socket

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_page.address import (
    is_local,
    listen,
    page_lines,
    parse,
    reachable_hosts,
    settled,
    written,
)


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('127.0.0.1:8765', ('127.0.0.1', 8765)),
        ('localhost:0', ('localhost', 0)),
        ('[::1]:80', ('::1', 80)),
        ('0.0.0.0:65535', ('0.0.0.0', 65535)),
        ('[::]:8080', ('::', 8080)),
        ('8080', ('127.0.0.1', 8080)),
        (':8080', ('127.0.0.1', 8080)),
        ('lab-pc.example:80', ('lab-pc.example', 80)),
    ],
)
def test_host_and_port_are_read(text, expected) -> None:
    assert parse(text) == expected


@pytest.mark.parametrize(
    'text',
    [
        '',
        '127.0.0.1',
        'host:',
        'host:http',
        'h:65536',
        'h:-1',
        'h:+80',
        'h:8 0',
        'h:٣٣',
        'http://127.0.0.1:8765',
        'a b:80',
        '[::1]',
        '[lab]:80',
        '::1:8765',
        '-h:80',
    ],
)
def test_anything_else_is_refused_with_an_example(text) -> None:
    with pytest.raises(InputError, match=r'write HOST:PORT, like 127\.0\.0\.1:8765') as caught:
        parse(text)
    assert '\n' not in str(caught.value)


def test_an_ipv6_address_without_brackets_is_corrected() -> None:
    with pytest.raises(InputError, match=r'did you mean \[fe80::1\]:80\?'):
        parse('fe80::1:80')


def test_a_port_in_use_names_the_option_that_changes_it() -> None:
    with listen('127.0.0.1:0') as first:
        port = first.getsockname()[1]
        with pytest.raises(InputError) as caught:
            listen(f'127.0.0.1:{port}')
    assert f'127.0.0.1:{port} is in use' in str(caught.value)
    assert '--page HOST:PORT' in str(caught.value)


def test_a_host_of_another_machine_is_refused() -> None:
    with pytest.raises(InputError, match=r'192\.0\.2\.1:8765'):
        listen('192.0.2.1:8765')


def test_a_name_that_nobody_knows_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r'no-such-host\.invalid:8765: ') as caught:
        listen('no-such-host.invalid:8765')
    assert '--page HOST:PORT' in str(caught.value)


def test_port_zero_becomes_a_free_port() -> None:
    host, port = parse(settled(':0'))
    assert host == '127.0.0.1'
    assert port > 0
    listen(written(host, port)).close()


def test_all_interfaces_of_ipv6_also_take_ipv4() -> None:
    if not socket.has_ipv6:
        pytest.skip('no IPv6 here')
    try:
        listening = listen('[::]:0')
    except InputError:
        pytest.skip('no IPv6 here')
    with listening:
        port = listening.getsockname()[1]
        socket.create_connection(('127.0.0.1', port), timeout=10).close()


def test_the_lines_name_every_address_with_the_token() -> None:
    assert page_lines('[::1]:80', 'secret') == ['page: http://[::1]:80/#token=secret']
    assert page_lines('lab:80', '100%&more') == ['page: http://lab:80/#token=100%25%26more']
    lines = page_lines('0.0.0.0:8765', 'secret')
    assert lines[0] == 'page: http://127.0.0.1:8765/#token=secret'
    assert len(lines) == len(reachable_hosts('0.0.0.0'))
    assert all(line.startswith('page from a phone: http://') for line in lines[1:])


def test_only_loopback_is_local() -> None:
    assert is_local('127.0.0.1')
    assert is_local('::1')
    assert is_local('localhost')
    assert not is_local('0.0.0.0')
    assert not is_local('192.168.1.7')
