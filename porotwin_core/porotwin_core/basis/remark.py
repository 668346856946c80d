"""The one record of an odd or impossible thing, for every check and every reader."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from porotwin_core.basis.plain_text import plain

NAMED = 3
"""Things of one kind that a remark names; more would hide the reason."""

QUOTED = 40
"""Characters of a wrong value that a message repeats."""


def first_of(names: Sequence[str]) -> str:
    """Return the first `NAMED` of `names`, and how many more there are: `a, b, c and 2 more`."""
    more = f' and {len(names) - NAMED} more' if len(names) > NAMED else ''
    return ', '.join(names[:NAMED]) + more


@dataclass(frozen=True)
class Remark:
    """An odd or impossible thing.

    Attributes:
        key: the thing: a key of `rig.yaml`, a file, or the maps.
        value: its value; empty where there is no single one.
        why: the reason.
        remedy: the way to mend it; empty if the reason names it.
        refused: the severity: an impossible thing must not be used, an odd one may.
        code: the kind of the oddity. Programs and tests compare it, because words may change.
        facts: the evidence that the words state, by names with units: numbers and places.
    """

    key: str
    value: str
    why: str
    remedy: str
    refused: bool = False
    code: str = ''
    facts: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @classmethod
    def of(cls, key: str, code: str, words: str, **facts: Any) -> 'Remark':
        """Return the remark with `words` about `facts`: the fault, a semicolon, the remedy.

        The words are a template: `{held_ml:.3g}` stands for a fact.
        """
        why, _, remedy = words.partition('; ')
        told = (why.format_map(facts), remedy.format_map(facts))
        return cls(key, '', *told, code=code, facts=facts)

    def __str__(self) -> str:
        """Return the remark on one line; a name of somebody else acts on no terminal."""
        about = f'{self.key} is {self.value}: ' if self.value else f'{self.key}: '
        return plain(about + '; '.join(filter(None, (self.why, self.remedy))))
