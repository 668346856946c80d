"""Tests of the rules for requests: hosts, origins, and the token."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_page.access import Access, AccessRefused, new_token, parse_hosts, token_in

ACCESS = Access('k7mq-3xwd-p9ra', frozenset({'rig.example.org'}))


@pytest.mark.parametrize(
    ('host', 'reached'),
    [
        ('localhost', '127.0.0.1'),
        ('localhost:9999', '127.0.0.1'),
        ('192.168.1.5:8765', '192.168.1.5'),
        ('192.168.1.5', '::ffff:192.168.1.5'),
        ('[fd00::5]:8765', 'fd00:0:0::5'),
        ('Rig.Example.org.', '192.168.1.5'),
    ],
)
def test_the_page_answers_under_its_names_and_the_address_that_was_reached(host, reached) -> None:
    ACCESS.check_host([host], reached)


@pytest.mark.parametrize(
    ('hosts', 'reached'),
    [
        (['192.168.1.6'], '192.168.1.5'),
        (['evil.example'], '127.0.0.1'),
        (['xrig.example.org'], '127.0.0.1'),
        ([''], ''),
        ([], ''),
        (['localhost', 'evil.example'], '127.0.0.1'),
        (['[::1'], '::1'),
    ],
)
def test_other_hosts_are_refused(hosts, reached) -> None:
    with pytest.raises(AccessRefused, match='parameter hosts'):
        ACCESS.check_host(hosts, reached)


@pytest.mark.parametrize(
    ('origin', 'token', 'words'),
    [
        (None, '', 'needs the token'),
        (None, 'k7mq-3xwd-p9rb', 'wrong token'),
        (None, '\udce4', 'wrong token'),
        ('http://evil.example', ACCESS.token, 'not from another site'),
        ('null', ACCESS.token, 'not from another site'),
    ],
)
def test_a_change_needs_the_token_and_the_pages_own_origin(origin, token, words) -> None:
    with pytest.raises(AccessRefused, match=words):
        ACCESS.check_change(origin, 'localhost:8765', token)


def test_a_change_from_the_page_with_its_token_is_allowed() -> None:
    for origin in (None, 'http://localhost:8765', 'https://LOCALHOST:8765'):
        ACCESS.check_change(origin, 'localhost:8765', ACCESS.token)


def test_tokens_differ_and_can_be_typed() -> None:
    tokens = {new_token() for _ in range(50)}
    assert len(tokens) == 50
    assert all(len(token) == 14 and token.count('-') == 2 for token in tokens)


def test_a_token_file_is_made_for_its_owner_alone_and_read_again(tmp_path: Path) -> None:
    path = tmp_path / 'token'
    token = token_in(path)
    assert token_in(path) == token
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize('content', ['', 'short', 'two words here', 'naïve-token'])
def test_a_file_without_a_good_token_is_refused(tmp_path: Path, content) -> None:
    path = tmp_path / 'token'
    path.write_text(content, encoding='utf-8')
    with pytest.raises(InputError, match='token'):
        token_in(path)


def test_a_token_file_that_cannot_be_made_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='No such file'):
        token_in(tmp_path / 'nowhere' / 'token')
    with pytest.raises(InputError):
        token_in(tmp_path)


def test_names_of_hosts_are_a_list() -> None:
    assert parse_hosts('') == frozenset()
    assert parse_hosts('Lab-PC, rig.example.org,') == {'lab-pc', 'rig.example.org'}
    for wrong in ('http://lab', 'lab:80', '*.example.org', 'a b'):
        with pytest.raises(InputError, match='names alone'):
            parse_hosts(wrong)
