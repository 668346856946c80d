"""Finds odd and impossible values in a description, with one remark for each."""

from porotwin_core.basis.check import Check, asked
from porotwin_core.basis.discovery import discovered
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig

CHECKS: dict[str, Check[Rig]] = discovered(
    'porotwin_core.rig.checks', 'CHECK', Check, 'porotwin_core/porotwin_core/basis/check.py'
)
"""All checks of a description by the names of their modules."""


def remarks_about(rig: Rig) -> tuple[Remark, ...]:
    """Return all remarks about `rig`, the impossible values first."""
    return asked(CHECKS, rig)
