"""The newest numbers of a running twin by name, for the adapters beside this file."""

import math
from pathlib import Path
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from porotwin_core.basis.units import ML, to_ml_h
from porotwin_core.rig import load_rig
from porotwin_core.ros import qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.node_thread import NodeThread
from porotwin_msgs.msg import CycleReport, Setpoint

UNITS = {'prediction_error': '', 'corrected_error': '', 'zone_tracer_ml': 'ml'}
"""Unit of each number of a cycle."""


def units_of(rig: Path) -> dict[str, str]:
    """Return the unit of every number by its name; a well's is NAME_ml_h, the rate of a setpoint.

    Raises:
        InputError: the description of the rig is wrong.
    """
    return {**{f'{well}_ml_h': 'ml/h' for well in load_rig(rig).wells}, **UNITS}


class TwinNumbers(Node):
    """Keeps the newest numbers in `newest`; NaN until they are known."""

    def __init__(self, rig: Path, namespace: str = 'porotwin', **kwargs: Any) -> None:
        """Follow the twin of `rig` in `namespace`; `kwargs` are for the node."""
        super().__init__('adapter', namespace=namespace, **kwargs)
        self.newest = dict.fromkeys(units_of(rig), math.nan)
        follow(self, Setpoint, 'wells/setpoint', self._on_setpoint, qos.SETPOINT)
        follow(self, CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD)

    def _on_setpoint(self, message: Setpoint) -> None:
        self.newest |= {f'{one.well}_ml_h': to_ml_h(one.rate) for one in message.wells}

    def _on_cycle(self, message: CycleReport) -> None:
        self.newest |= {
            'prediction_error': message.prediction_error,
            'corrected_error': message.corrected_error,
            'zone_tracer_ml': message.disallowed_tracer * ML,
        }


def follow_twin(rig: Path) -> tuple[TwinNumbers, NodeThread]:
    """Return the numbers of the twin of `rig`, and the thread that keeps them new until its end."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # the program ends as others do
    node = TwinNumbers(rig)
    return node, NodeThread(node)
