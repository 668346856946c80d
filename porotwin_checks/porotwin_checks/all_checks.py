"""All checks, found in their folder, and the one function that asks them."""

from collections.abc import Mapping

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check, asked
from porotwin_core.basis.discovery import discovered
from porotwin_core.basis.remark import Remark

CHECKS: dict[str, Check[Known]] = discovered(
    f'{__package__}.checks', 'CHECK', Check, 'porotwin_core/porotwin_core/basis/check.py'
)
"""All checks by the names of their modules, in alphabetical order."""

OF_RIG = {name: check for name, check in CHECKS.items() if 'rig' in check.needs}
"""The checks of a rig: who starts a twin, or works with a recording of it, asks them."""

OF_PHOTOGRAPHS = {name: check for name, check in CHECKS.items() if 'seen_photos' in check.needs}
"""The checks of the files of photographs: whoever reads these asks them."""

OF_MAPS = {
    name: check
    for name, check in CHECKS.items()
    if not {'maps', 'scaled_maps'}.isdisjoint(check.needs)
}
OF_TABLES = {
    name: check for name, check in CHECKS.items() if name not in OF_MAPS | OF_RIG | OF_PHOTOGRAPHS
}
"""The checks that read the values of maps, and the others: whoever opens a recording asks these."""


def remarks_about(known: Known, checks: Mapping[str, Check[Known]] = CHECKS) -> tuple[Remark, ...]:
    """Return the remarks of `checks` about the `known` data, the impossible things first.

    The tables are read first. What they show explains remarks about maps.
    """
    return asked(checks, known, OF_TABLES)
