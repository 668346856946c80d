"""HTML parts of the report: tables, figures, numbers."""

import base64
import html
import io
from collections.abc import Collection, Sequence

from matplotlib.figure import Figure

from porotwin_core.basis import units

RESOLUTION = 130
"""Dots per inch of the figures: 1560 pixels across a page of 1080, sharp on fine screens too."""

PIXELS_PER_INCH = 90
"""Width of a figure on the page [pixels/inch]: 12 inches fill it."""

WIDE_PIXELS = 700
"""Wider figures have several panels; on a telephone they scroll sideways."""


def table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: Collection[int] = ()) -> str:
    """Return a table of HTML cells; the columns in `numbers` are aligned to the right."""

    def row(cells: Sequence[str], tag: str) -> str:
        marks = [' class="n"' if index in numbers else '' for index in range(len(cells))]
        joined = ''.join(
            f'<{tag}{mark}>{cell}</{tag}>' for mark, cell in zip(marks, cells, strict=True)
        )
        return f'<tr>{joined}</tr>'

    lines = f'{row(head, "th")}{"".join(row(cells, "td") for cells in rows)}'
    return f'<div class="wide"><table>{lines}</table></div>'


def figure_with_caption(figure: Figure, caption: str, kind: str = 'png') -> str:
    """Return `figure` as an image within the page, of `kind` png or jpeg, with its `caption`."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=RESOLUTION)
    content = base64.b64encode(buffer.getvalue()).decode('ascii')
    text = html.escape(caption)
    width = round(PIXELS_PER_INCH * figure.get_figwidth())
    kept = ' class="single"' if width < WIDE_PIXELS else ''
    source = f'data:image/{kind};base64,{content}'
    return (
        f'<figure><div class="wide"><img width="{width}"{kept} alt="{text}" src="{source}"></div>'
        f'<figcaption>{text}</figcaption></figure>'
    )


def percent(share: float) -> str:
    """Return `share` in per cent, to one decimal."""
    return units.percent(share, 1)
