"""The effects that act in the solver, as it tells them on `model/effects`."""

from collections.abc import Callable
from typing import NamedTuple

from rclpy.node import Node

from porotwin_core.rig import EffectDescription
from porotwin_core.ros import qos
from porotwin_core.ros.following import RefuseFn, follow
from porotwin_core.ros.from_messages import effects_from_msg
from porotwin_msgs.msg import ModelEffects


class ToldEffects(NamedTuple):
    """What the solver told: its effects beyond those of rig.yaml, and how many it told before."""

    effects: tuple[EffectDescription, ...]
    sequence: int


def follow_effects(
    node: Node,
    on_effects: Callable[[ToldEffects], None],
    *,
    refuse: RefuseFn | None = None,
) -> None:
    """Subscribe `node` to the effects of the solver; those of any other sender are ignored.

    Args:
        node: the node.
        on_effects: takes what the solver told; it may raise InputError to ignore it.
        refuse: as in `follow`.
    """

    def on_message(message: ModelEffects) -> None:
        on_effects(ToldEffects(effects_from_msg(message.effects), message.sequence))

    follow(node, ModelEffects, 'model/effects', on_message, qos.CONFIG, refuse=refuse)
