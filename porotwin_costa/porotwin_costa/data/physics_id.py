"""The identity of a physics-based model: a correction is valid for one model only."""

from dataclasses import dataclass
from typing import Self

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig


@dataclass(frozen=True)
class PhysicsId:
    """The preset of a physics-based model and the fingerprint of its rig description.

    A field is empty where it is not known: in a file of version 0.1, or without a named preset.
    """

    preset: str = ''
    rig: str = ''

    @classmethod
    def of(cls, rig: Rig, preset: str) -> Self:
        """Return the identity of the model of `rig` with the numerical scheme `preset`."""
        return cls(preset, rig.physics_fingerprint)

    @property
    def known(self) -> bool:
        """Whether preset and rig are both known, so that every difference is found."""
        return bool(self.preset and self.rig)

    def difference(self, other: Self) -> str:
        """Return how `other` differs, as far as both are known, or an empty string."""
        if self.preset and other.preset and self.preset != other.preset:
            return f"preset '{self.preset}', not '{other.preset}'"
        if self.rig and other.rig and self.rig != other.rig:
            return (
                f'rig {self.rig}, not {other.rig} (sand, wells, boundaries or effects of rig.yaml)'
            )
        return ''


def untaught(rig: Rig) -> str:
    """Return what moves the water of `rig` and no correction knows, or an empty string."""
    return 'levels of water change, which COSTA does not know' if rig.levels else ''


def refuse_untaught(rig: Rig) -> None:
    """Refuse to learn the errors of a model of `rig` that no correction can know.

    Raises:
        InputError: there are some.
    """
    if unknown := untaught(rig):
        raise InputError(f'rig.yaml: {unknown}; name a rig.yaml without levels')
