"""A picture of the report, as it stands within the page."""

import base64
import io
from dataclasses import dataclass
from typing import Self

from matplotlib.figure import Figure

from porotwin_core.rig.rig_on_axes import DOTS_PER_INCH

PIXELS_PER_INCH = 90
"""Width of a figure on the page [pixels/inch]: 12 inches fill it."""

WIDE_PIXELS = 700
"""Wider figures have several panels; on a telephone they scroll sideways."""


@dataclass(frozen=True)
class Picture:
    """A picture with its caption.

    Attributes:
        source: the file as a URL that holds it.
        width: its width on the page [pixels].
        caption: what it shows.
    """

    source: str
    width: int
    caption: str

    @classmethod
    def drawn(cls, figure: Figure, caption: str, kind: str = 'png') -> Self:
        """Return `figure` as a picture of `kind` png or jpeg."""
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind, dpi=DOTS_PER_INCH)
        content = base64.b64encode(buffer.getvalue()).decode('ascii')
        width = round(PIXELS_PER_INCH * figure.get_figwidth())
        return cls(f'data:image/{kind};base64,{content}', width, caption)

    @property
    def is_single(self) -> bool:
        """Whether it fits a telephone."""
        return self.width < WIDE_PIXELS
