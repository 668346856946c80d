"""The class of checks."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from porotwin_checks.known import Known
from porotwin_core.basis.remark import Remark


@dataclass(frozen=True)
class Check:
    """One question about an experiment.

    A module of the folder `checks` defines `CHECK`. Its code is the name of the module, where a
    remark names none.

    Attributes:
        needs: attributes of `Known` without which it cannot be asked.
        find: yields the remarks.
        explained_by: codes of other remarks; with one of them this check is silent.
    """

    needs: tuple[str, ...]
    find: Callable[[Known], Iterator[Remark]]
    explained_by: tuple[str, ...] = ()

    @property
    def opens_maps(self) -> bool:
        """Whether it reads the values of maps."""
        return not {'maps', 'scaled_maps'}.isdisjoint(self.needs)
