"""The topics with the course of a run: maps, rates, interruptions, effects, its start."""

import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Header

from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import KnownRates
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.model_effects import ToldEffects, follow_effects
from porotwin_msgs.msg import CleanState, NewState, Setpoint, WellRates


def follow_run(
    node: Node,
    *,
    rates: RateHistory,
    lock: AbstractContextManager[Any],
    on_state: Callable[[NewState], None],
    on_clean_state: Callable[[CleanState], None],
    on_effects: Callable[[ToldEffects], None],
) -> None:
    """Subscribe `node` to the course of a run.

    Args:
        node: the node.
        rates: takes the rates that the hub commands, those that the pumps delivered, and the start
            of the experiment; in simulated time it is 0. Wrong rates are an error in the log.
        lock: is held meanwhile; a condition is notified.
        on_state: takes every map.
        on_clean_state: takes the message that a new sequence of states begins.
        on_effects: takes the effects in the solver; InputError from it ignores them.
    """

    def on_measured(message: WellRates) -> None:
        start = conversions.time_from_msg(message.start)
        end = conversions.time_from_msg(message.header.stamp)
        told = conversions.rates_from_msg(message.wells)
        with lock:
            rates.add_known(KnownRates(start, end, told))
            notify()

    def on_setpoint(message: Setpoint) -> None:
        stamp = conversions.time_from_msg(message.header.stamp)
        until = conversions.time_from_msg(message.valid_until)
        told = conversions.rates_from_msg(message.wells)
        with lock:
            rates.add_commanded(stamp, told, until)
            notify()

    def notify() -> None:
        if isinstance(lock, threading.Condition):
            lock.notify_all()

    def on_start(began: float) -> None:
        rates.told_start = began

    follow(node, WellRates, 'wells/measured', on_measured, qos.FIELD)
    # every setpoint of a run counts, not only the newest as for a pump
    follow(node, Setpoint, 'wells/setpoint', on_setpoint, qos.FIELD)
    follow(node, CleanState, 'asset/clean_state', on_clean_state, qos.FIELD)
    follow_effects(node, on_effects)
    follow(node, NewState, 'asset/new_state', on_state, qos.FIELD)
    follow_start(node, on_start)


def follow_start(node: Node, on_start: Callable[[float], None]) -> None:
    """Tell `on_start` the start of the experiment [s] by the clock of the photographs.

    Imaging tells it, once it is known. In simulated time it is 0.
    """
    if node.get_parameter('use_sim_time').value:
        on_start(0.0)
        return

    def on_experiment(message: Header) -> None:
        on_start(conversions.time_from_msg(message.stamp))

    follow(node, Header, 'asset/experiment', on_experiment, qos.CONFIG)
