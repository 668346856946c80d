"""A check: one question about one kind of thing, in one file."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from porotwin_core.basis.remark import Remark

T = TypeVar('T')


@dataclass(frozen=True)
class Check(Generic[T]):
    """One question.

    A module of a folder of checks defines `CHECK`. Its code is the name of the module, where a
    remark names none.

    Attributes:
        find: yields the remarks about a thing.
        needs: attributes of the thing without which it cannot be asked.
        explained_by: codes of other remarks; with one of them this check is silent.
    """

    find: Callable[[T], Iterator[Remark]]
    needs: tuple[str, ...] = ()
    explained_by: tuple[str, ...] = ()


def asked(
    checks: Mapping[str, Check[T]], about: Any, told_before: Mapping[str, Check[T]] | None = None
) -> tuple[Remark, ...]:
    """Return the remarks of `checks` about a thing, the impossible ones first.

    `about.has` tells whether it knows an attribute that a check needs. Remarks of the checks
    `told_before` are left out, but they explain others.
    """
    found = {
        name: [replace(one, code=one.code or name) for one in check.find(about)]
        for name, check in {**(told_before or {}), **checks}.items()
        if all(about.has(needed) for needed in check.needs)
    }
    codes = {remark.code for remarks in found.values() for remark in remarks}
    told = [
        remark
        for name, remarks in found.items()
        if name in checks and codes.isdisjoint(checks[name].explained_by)
        for remark in remarks
    ]
    return tuple(sorted(told, key=lambda remark: not remark.refused))
