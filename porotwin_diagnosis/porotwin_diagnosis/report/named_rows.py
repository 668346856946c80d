"""Finds the rows of diagnosis.json for named effects; a name may come twice, for two wells."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

Item = TypeVar('Item')


def with_occurrences(names: Iterable[str]) -> Iterator[tuple[str, int]]:
    """Yield each of `names` with the number of times that it came before."""
    seen: Counter[str] = Counter()
    for name in names:
        yield name, seen[name]
        seen[name] += 1


def named_rows(summary: Mapping[str, Any], names: Iterable[str]) -> list[Mapping[str, Any]]:
    """Return the rows of the effects `names` in the content of a diagnosis.json, in their order.

    A name that comes twice gets two rows.

    Raises:
        KeyError: an effect has no row.
    """
    return [
        occurrence([row for row in summary['effects'] if row['name'] == name], number, name)
        for name, number in with_occurrences(names)
    ]


def verdict_words(summary: Mapping[str, Any]) -> str:
    """Return the verdict in the content of a diagnosis.json, with all effects that act together."""
    return ' and '.join(summary['combination']) or str(summary['verdict'])


def occurrence(items: Sequence[Item], number: int, name: str) -> Item:
    """Return item `number` of those that belong to `name`.

    Raises:
        KeyError: there are fewer.
    """
    if number >= len(items):
        raise KeyError(name)
    return items[number]
