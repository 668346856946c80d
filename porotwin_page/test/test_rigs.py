"""Tests of the choice of a rig."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_page.rigs import SOCKETS, RigList, announce, named_pages, pages_here


@pytest.mark.skipif(not SOCKETS.is_file(), reason='needs /proc/net/unix of Linux')
def test_pages_of_this_machine_are_found_while_they_live() -> None:
    first = announce('/rig1', 201, '0.0.0.0', 18765)
    with announce('/lab/rig2', 202, '127.0.0.1', 18766):
        rigs = RigList(18765, {'west': 'http://lab2:8765'})
        found = {rig['name']: rig for rig in rigs.offered('127.0.0.1')}
        assert found['rig1 (domain 201)']['address'] == 'http://127.0.0.1:18765/'
        assert found['rig1 (domain 201)']['own']
        assert not found['lab/rig2 (domain 202)']['own']
        assert found['west']['address'] == 'http://lab2:8765'
        # a browser elsewhere cannot reach a page that listens on this machine only
        assert 'lab/rig2 (domain 202)' not in {rig['name'] for rig in rigs.offered('lab1')}
    first.close()
    assert 'rig1 (domain 201)' not in {page.name for page in pages_here(SOCKETS.read_text())}


def test_other_sockets_are_no_pages() -> None:
    lines = ['00: 00000002 0 01 @porotwin_page|x|1||rig', '00: 01 /tmp/porotwin_page|1|1||rig']
    assert pages_here(chr(10).join(lines)) == []


@pytest.mark.parametrize('text', ['west', 'west=lab2:8765', '=http://lab2:8765'])
def test_a_rig_elsewhere_needs_a_name_and_an_address(text: str) -> None:
    with pytest.raises(InputError, match='NAME=http://HOST:PORT'):
        named_pages(text)
