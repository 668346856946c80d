"""The language of the project is plain: few clauses that are hard to read."""

import prose
import pytest


@pytest.mark.parametrize('name', prose.packages())
def test_hard_clauses_are_rare(name: str) -> None:
    words, clauses = prose.count(name)
    rate = 1000 * clauses / max(words, 1)
    assert rate < prose.MOST_PER_1000, (
        f'{name}: {rate:.1f} hard clauses per 1,000 words; list them with '
        f'`python tests/prose.py {name}` and rewrite the sentences'
    )
