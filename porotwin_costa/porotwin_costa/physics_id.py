"""Which physics-based model was corrected: a correction is right for that one only."""

from dataclasses import dataclass
from typing import Self

from porotwin_core.rig import Rig


@dataclass(frozen=True)
class PhysicsId:
    """The scheme of a physics-based model, and the fingerprint of the rig that it believes in.

    Empty where it is not known: a file of before this was kept, a scheme that nobody named.
    """

    preset: str = ''
    rig: str = ''

    @classmethod
    def of(cls, rig: Rig, preset: str) -> Self:
        """Return that of the physics of `rig` with the scheme `preset`."""
        return cls(preset, rig.physics_fingerprint)

    @property
    def known(self) -> bool:
        """Whether both are known, so that a difference will be found."""
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
