"""The topics with the course of a run: maps, rates, interruptions, effects."""

from collections.abc import Callable
from functools import partial

from rclpy.node import Node

from porotwin_core.basis.errors import InputError
from porotwin_core.ros import qos
from porotwin_core.ros.foreign_words import FewWords
from porotwin_core.ros.model_effects import ToldEffects, follow_effects
from porotwin_core.ros.senders import check_only_pumps_measure
from porotwin_msgs.msg import CleanState, NewState, Setpoint, WellRates


def follow_run(
    node: Node,
    *,
    on_state: Callable[[NewState], None],
    on_setpoint: Callable[[Setpoint], None],
    on_measured: Callable[[WellRates], None],
    on_clean_state: Callable[[CleanState], None],
    on_effects: Callable[[ToldEffects], None],
) -> None:
    """Subscribe `node` to the course of a run.

    Args:
        node: the node.
        on_state: takes every map.
        on_setpoint: takes the rates that the hub commands.
        on_measured: takes the rates that the pumps delivered.
        on_clean_state: takes the message that a new sequence of states begins.
        on_effects: takes the effects in the solver; InputError from it ignores them.
    """
    follow_measured(node, on_measured)
    # every setpoint of a run counts, not only the newest as for a pump
    node.create_subscription(Setpoint, 'wells/setpoint', on_setpoint, qos.FIELD)
    node.create_subscription(CleanState, 'asset/clean_state', on_clean_state, qos.FIELD)
    follow_effects(node, on_effects)
    node.create_subscription(NewState, 'asset/new_state', on_state, qos.FIELD)


def follow_measured(
    node: Node,
    on_measured: Callable[[WellRates], None],
    *,
    refuse: Callable[[str], None] | None = None,
) -> None:
    """Subscribe `node` to measured rates; all are ignored while a foreign node could send them.

    Args:
        node: the node.
        on_measured: takes the rates; it may raise InputError to ignore them.
        refuse: takes one line about ignored rates; None: the log of the node, a few a minute.
    """
    complain = refuse or partial(FewWords(node.get_logger().error).tell, 'wells/measured')

    def on_message(message: WellRates) -> None:
        try:
            check_only_pumps_measure(node)
            on_measured(message)
        except InputError as error:
            complain(f'measured rates ignored: {error}')

    node.create_subscription(WellRates, 'wells/measured', on_message, qos.FIELD)
