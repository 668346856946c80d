"""The topics with the course of a run: maps, rates, interruptions, effects."""

from collections.abc import Callable

from rclpy.node import Node

from porotwin_core import qos
from porotwin_msgs.msg import CleanState, ModelEffects, NewState, Setpoint, WellRates


def follow_run(
    node: Node,
    *,
    on_state: Callable[[NewState], None],
    on_setpoint: Callable[[Setpoint], None],
    on_measured: Callable[[WellRates], None],
    on_clean_state: Callable[[CleanState], None],
    on_effects: Callable[[ModelEffects], None],
) -> None:
    """Subscribe `node` to the course of a run.

    Args:
        node: the node.
        on_state: takes every map.
        on_setpoint: takes the rates that the hub commands.
        on_measured: takes the rates that the pumps delivered.
        on_clean_state: takes the message that a new sequence of states begins.
        on_effects: takes the effects that act in the solver.
    """
    node.create_subscription(WellRates, 'wells/measured', on_measured, qos.FIELD)
    node.create_subscription(Setpoint, 'wells/setpoint', on_setpoint, qos.SETPOINT)
    node.create_subscription(CleanState, 'asset/clean_state', on_clean_state, qos.FIELD)
    node.create_subscription(ModelEffects, 'model/effects', on_effects, qos.CONFIG)
    node.create_subscription(NewState, 'asset/new_state', on_state, qos.FIELD)
