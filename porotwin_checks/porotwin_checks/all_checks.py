"""All checks, found in their folder, and the one function that asks them."""

from collections.abc import Mapping
from dataclasses import replace

from porotwin_checks.check import Check
from porotwin_checks.known import Known
from porotwin_core.basis.discovery import discovered
from porotwin_core.basis.remark import Remark

CHECKS: dict[str, Check] = discovered(
    f'{__package__}.checks', 'CHECK', Check, 'porotwin_checks/porotwin_checks/check.py'
)
"""All checks by the names of their modules, in alphabetical order."""


OF_MAPS = {name: check for name, check in CHECKS.items() if check.opens_maps}
OF_TABLES = {name: check for name, check in CHECKS.items() if not check.opens_maps}
"""The checks that read the values of maps, and the others: whoever opens a recording asks these."""


def remarks_about(known: Known, checks: Mapping[str, Check] = CHECKS) -> tuple[Remark, ...]:
    """Return the remarks of `checks` about the `known` data, the impossible things first."""
    found = {
        name: [replace(one, code=one.code or name) for one in check.find(known)]
        for name, check in checks.items()
        if all(map(known.has, check.needs))
    }
    codes = {remark.code for remarks in found.values() for remark in remarks}
    told = [
        remark
        for name, remarks in found.items()
        if codes.isdisjoint(checks[name].explained_by)
        for remark in remarks
    ]
    return tuple(sorted(told, key=lambda remark: not remark.refused))
