"""Maps and rates for viewers that know no message of ours: Foxglove, RViz, rqt, PlotJuggler."""

import math
import re
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.publisher import Publisher
from sensor_msgs.msg import Image
from std_msgs.msg import Float64

from porotwin_core.basis.units import ML, to_ml_h
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.node import Diagnostics, TwinNode, run
from porotwin_msgs.msg import CycleReport, NewState, Setpoint, TracerField, WellRates
from porotwin_page.map_pictures import colour_table, on_grey, paint

MAPS = ('observed', 'predicted', 'corrected')
"""Maps of the twin."""

NUMBERS = ('prediction_error', 'corrected_error', 'disallowed_tracer_ml')
"""Numbers of one cycle; the rates of wells come beside them."""


class DisplayNode(TwinNode):
    """Repeats maps as pictures, and rates and errors as single numbers, for foreign viewers.

    Viewers that come late get the last of each.
    """

    def __init__(self, **kwargs: Any) -> None:
        """Follow the twin; `kwargs` are for the node."""
        super().__init__('display', **kwargs)
        shown = [*MAPS, *(f'{name}_coloured' for name in MAPS)]
        kinds: dict[str, type[Any]] = {
            **dict.fromkeys(shown, Image),
            **dict.fromkeys(NUMBERS, Float64),
        }
        self._made = {name: self._publisher(name, kind) for name, kind in kinds.items()}
        self._parts: dict[str, str] = {}
        """Names of wells in topics, by well."""
        self._table = colour_table('concentration', 'light')
        self._diagnostics = Diagnostics(self)
        follow(self, NewState, 'asset/new_state', self._on_state, qos.FIELD)
        for name in MAPS[1:]:
            follow(self, TracerField, f'tracer/{name}', partial(self._show, name), qos.FIELD)
        for topic, kind in (('wells/setpoint', Setpoint), ('wells/measured', WellRates)):
            tell = partial(self._tell_rates, topic.removeprefix('wells/'))
            follow(self, kind, topic, tell, qos.FIELD)
        follow(self, CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD)

    def _publisher(self, name: str, kind: type[Any]) -> Publisher:
        return self.create_publisher(kind, f'display/{name}', qos.CONFIG)

    def _on_state(self, message: NewState) -> None:
        self._show(MAPS[0], message.tracer)
        self._diagnostics.report(DiagnosticStatus.OK, f'state {message.sequence} is shown')

    def _show(self, name: str, message: TracerField) -> None:
        """Publish a map as its numbers and as a picture."""
        values, _ = conversions.tracer_from_msg(message)
        picture = on_grey(paint(values, 0.0, 1.0, self._table))
        for topic, pixels in ((name, values[::-1]), (f'{name}_coloured', picture)):
            self._made[topic].publish(conversions.image_to_msg(pixels, message.header))

    def _tell_rates(self, name: str, message: Setpoint | WellRates) -> None:
        for rate in message.wells:
            self._tell(f'{name}_ml_h/{self._part(rate.well)}', to_ml_h(rate.rate))

    def _part(self, well: str) -> str:
        if well not in self._parts:
            name = topic_part(well)
            taken = self._parts.values()
            self._parts[well] = f'{name}_{len(taken)}' if name in taken else name
        return self._parts[well]

    def _on_cycle(self, message: CycleReport) -> None:
        numbers = (
            message.prediction_error, message.corrected_error, ML * message.disallowed_tracer,
        )  # fmt: skip
        for name, value in zip(NUMBERS, numbers, strict=True):
            self._tell(name, value)

    def _tell(self, name: str, value: float) -> None:
        if math.isfinite(value):
            if name not in self._made:  # a rate of a well
                self._made[name] = self._publisher(name, Float64)
            self._made[name].publish(Float64(data=value))


def topic_part(well: str) -> str:
    """Return the name of a well as ROS allows it in a topic: letters of ASCII, digits, single _."""
    name = re.sub(r'[^a-z0-9]+', '_', well, flags=re.IGNORECASE | re.ASCII).strip('_')
    return name if name[:1].isalpha() else f'well_{name}'.rstrip('_')


def main() -> None:
    """Run the node."""
    run(DisplayNode)


if __name__ == '__main__':
    main()
