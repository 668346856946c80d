"""The architectures: found by themselves, chosen by name, described in files."""

import pytest

from porotwin_core.errors import InputError
from porotwin_costa.networks import ARCHITECTURES, architecture


def test_every_module_with_an_architecture_is_found():
    assert list(ARCHITECTURES) == ['local', 'paper', 'paper-complex']
    assert all(found.name == name for name, found in ARCHITECTURES.items())
    assert all('\n' not in found.summary and found.summary for found in ARCHITECTURES.values())


def test_the_network_of_the_paper_is_the_default():
    assert architecture() is architecture('paper')


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"'unknown'.*local, paper, paper-complex"):
        architecture('unknown')
    with pytest.raises(InputError, match='transformer'):
        architecture('transformer')


@pytest.mark.parametrize('name', ARCHITECTURES)
def test_description_gives_the_architecture_back(name):
    chosen = architecture(name)
    description = chosen.description()
    assert description['architecture'] == name
    assert chosen.described(description) == chosen
    smaller = chosen.described({'filters': 3})
    assert smaller.settings.filters == 3
    assert smaller.description() == {**description, 'filters': 3}
