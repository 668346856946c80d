"""Knowledge of the plant beyond its model: pumps, person, and physics."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS, LearntPhysics
from porotwin_core.rates.order_delay import AT_ONCE, OrdersAhead

DEAD_SHARE = 0.25
"""A pump that delivers less than this share of its rate has failed: photographs tell a smaller one
from none no longer, and a plan goes on without it."""

STANDS = 0.02
"""Least share that is believed: a pump that stands still can so be told apart from one that was
told to stand."""


@dataclass(frozen=True)
class PlantKnowledge:
    """What a decision takes into account beside the model, the state and the rates in force.

    Attributes:
        delivery: the share of its commanded rate that each pump delivers; 1 where absent.
        ahead: the rates in force until an order of now will be set.
        learnt: the physics that the data-driven model corrects by.
    """

    delivery: Mapping[str, float] = field(default_factory=dict)
    ahead: OrdersAhead = AT_ONCE
    learnt: LearntPhysics = NO_LEARNT_PHYSICS


NOTHING_LEARNT = PlantKnowledge()
"""Pumps deliver what they are told, orders are set at once, and the model is right."""
