"""Panels of the page: their content from a snapshot, and their drawing.

A panel is one module in the folder `panels` with a constant PANEL of one of these kinds:

- `LinesPanel`: lines of text.
- `ChartPanel`: curves over time, one value per cycle.
- `MapPanel`: a map of the rig as a picture.
- `ScriptPanel`: any content, drawn by a JavaScript module of the same name beside the Python file.
  It exports `create(root, declaration, page)`, which returns a function of the content.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar

from porotwin_core.geometry.grid import FloatArray
from porotwin_page.graph_snapshot import CyclePoint, GraphSnapshot
from porotwin_page.json_values import Json, finite
from porotwin_page.map_pictures import Quantity, Theme, colour_table, paint, png, scale


class Region(StrEnum):
    """Part of the page; its panels follow each other by their `order`."""

    ACTIONS = 'actions'
    MAPS = 'maps'
    STATUS = 'status'
    CURVES = 'curves'


@dataclass(frozen=True)
class Moment:
    """The present time.

    Attributes:
        graph: on the graph's clock [s]; None if it has not started.
        steady: on this machine's steady clock [s], for ages.
    """

    graph: float | None
    steady: float


@dataclass(frozen=True, kw_only=True)
class Panel:
    """The base of all panels.

    Attributes:
        title: heading; empty for a panel without heading and frame.
        region: where the panel lies.
        order: position among the panels of its region, smallest first.
    """

    title: str
    region: Region
    order: int
    drawing: ClassVar[str]
    """Kind of panel, for the browser."""

    def declaration(self) -> Json:
        """Return all constant data of the panel, for the browser."""
        return {'title': self.title, 'region': str(self.region), 'drawing': self.drawing}

    def content(self, snapshot: GraphSnapshot, moment: Moment) -> Any:
        """Return the content, ready for JSON without NaN; None if there is none yet."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class ScriptPanel(Panel):
    """Any content, drawn by a JavaScript module of its own.

    Attributes:
        view: returns the content, ready for JSON.
    """

    view: Callable[[GraphSnapshot, Moment], Any]
    drawing: ClassVar[str] = 'script'

    def content(self, snapshot: GraphSnapshot, moment: Moment) -> Any:
        """Return the content, ready for JSON."""
        return self.view(snapshot, moment)


@dataclass(frozen=True, kw_only=True)
class LinesPanel(Panel):
    """Lines of text; without lines the panel is hidden.

    Attributes:
        lines: returns the lines.
    """

    lines: Callable[[GraphSnapshot, Moment], Sequence[str]]
    drawing: ClassVar[str] = 'lines'

    def content(self, snapshot: GraphSnapshot, moment: Moment) -> list[str]:
        """Return the lines."""
        return list(self.lines(snapshot, moment))


@dataclass(frozen=True, kw_only=True)
class ChartPanel(Panel):
    """Curves over time. Their values travel with the history, once for every cycle.

    Attributes:
        values: returns the values of all curves in one cycle, by name; None or NaN interrupts the
            curve. The order of the names selects the colours. A single curve may have no name.
        unit: unit of the values.
        dashed: names of curves that are dashed beside others.
        steps: whether a value holds until the next one.
        digits: digits after the decimal point in the legend; None: three significant digits.
    """

    values: Callable[[CyclePoint], Mapping[str, float | None]]
    unit: str
    dashed: tuple[str, ...] = ()
    steps: bool = False
    digits: int | None = None
    drawing: ClassVar[str] = 'chart'

    def declaration(self) -> Json:
        """Return all constant data of the panel, for the browser."""
        return super().declaration() | {
            'unit': self.unit,
            'dashed': list(self.dashed),
            'steps': self.steps,
            'digits': self.digits,
        }

    def content(self, snapshot: GraphSnapshot, moment: Moment) -> None:
        """Return None: all values are in the history."""

    def point(self, cycle: CyclePoint) -> dict[str, float | None]:
        """Return the values of one cycle by curve, ready for JSON."""
        return {name: finite(value) for name, value in self.values(cycle).items()}


@dataclass(frozen=True)
class ShownMap:
    """A map and the limits of its colours.

    Attributes:
        values: (nz, nx) [-], row 0 at the bottom; NaN where nothing was seen.
        time: when the map is valid [s].
        number: changes with every new map.
        low: value of the first colour [-].
        high: value of the last colour [-].
        notes: short texts behind the time.
    """

    values: FloatArray
    time: float
    number: int
    low: float = 0.0
    high: float = 1.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class MapPanel(Panel):
    """A map of the rig with wells and disallowed zone.

    Attributes:
        shown: returns the map; None if there is none yet.
        quantity: selects the colours; differences have signed limits.
        unit: text at the colour scale.
        empty: text while there is no map.
        time_prefix: word before the time.
        large: whether the map is wide, with labels and the warning about old photographs.
    """

    shown: Callable[[GraphSnapshot], ShownMap | None]
    empty: str
    quantity: Quantity = 'concentration'
    unit: str = 'concentration'
    time_prefix: str = ''
    large: bool = False
    drawing: ClassVar[str] = 'map'

    def declaration(self) -> Json:
        """Return all constant data of the panel, for the browser."""
        return super().declaration() | {
            'unit': self.unit,
            'empty': self.empty,
            'time_prefix': self.time_prefix,
            'large': self.large,
            'signed': self.quantity == 'difference',
        }

    def content(self, snapshot: GraphSnapshot, moment: Moment) -> Json | None:  # noqa: ARG002
        """Return time, number, limits and notes of the map; its picture is fetched by number."""
        shown = self.shown(snapshot)
        if shown is None:
            return None
        return {
            'number': shown.number,
            'time_s': shown.time,
            'low': shown.low,
            'high': shown.high,
            'notes': list(shown.notes),
        }

    def picture(self, snapshot: GraphSnapshot, theme: Theme) -> bytes | None:
        """Return the map as a PNG file; None if there is none yet."""
        shown = self.shown(snapshot)
        if shown is None:
            return None
        table = colour_table(self.quantity, theme)
        return png(paint(shown.values, shown.low, shown.high, table))

    def scale(self, theme: Theme) -> bytes:
        """Return the colours of the scale as a PNG file of 256 x 1 pixels."""
        return scale(self.quantity, theme)
