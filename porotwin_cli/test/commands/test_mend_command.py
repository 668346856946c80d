"""./porotwin mend."""

from cli_examples import porotwin


def test_a_number_that_no_offer_has_is_refused_in_one_line() -> None:
    found = porotwin('mend', 'accept', '--offer', '99999999999999999999999')
    assert found.returncode == 2
    assert len(found.stderr.splitlines()) == 1
    assert 'offer 99999999999999999999999: no offer has this number' in found.stderr
