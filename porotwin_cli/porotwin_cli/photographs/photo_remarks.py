"""Remarks about photographs, told while a command images many of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from porotwin_core.ros.foreign_words import FEW


@dataclass
class PhotoRemarks:
    """Tells the first remarks with their photographs, and counts the others.

    Attributes:
        say: tells a line.
    """

    say: Callable[[str], None]
    _count: int = field(default=0, init=False)
    _photos: set[str] = field(default_factory=set, init=False)

    def tell(self, photo: str, remarks: Sequence[str]) -> None:
        """Tell the `remarks` about a `photo`, or keep their number."""
        for remark in remarks:
            self._count += 1
            if self._count <= FEW:
                self.say(f'{photo}: {remark}')
            else:
                self._photos.add(photo)

    def tell_the_rest(self) -> None:
        """Tell how many remarks were not told."""
        if self._photos:
            self.say(
                f'{self._count - FEW} more remarks about {len(self._photos)} photographs; '
                '--json lists them all'
            )
