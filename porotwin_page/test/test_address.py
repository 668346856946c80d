"""Tests of the address HOST:PORT."""

import pytest

from porotwin_core.errors import InputError
from porotwin_page.address import is_local, listen, parse


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('127.0.0.1:8765', ('127.0.0.1', 8765)),
        ('localhost:0', ('localhost', 0)),
        ('[::1]:80', ('::1', 80)),
        ('0.0.0.0:65535', ('0.0.0.0', 65535)),
    ],
)
def test_host_and_port_are_read(text, expected) -> None:
    assert parse(text) == expected


@pytest.mark.parametrize(
    'text', ['', '8765', ':8765', '127.0.0.1', 'host:', 'host:http', 'h:65536']
)
def test_anything_else_is_refused_with_an_example(text) -> None:
    with pytest.raises(InputError, match=r'write HOST:PORT, like 127\.0\.0\.1:8765'):
        parse(text)


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


def test_only_loopback_is_local() -> None:
    assert is_local('127.0.0.1')
    assert is_local('::1')
    assert is_local('localhost')
    assert not is_local('0.0.0.0')
    assert not is_local('192.168.1.7')
