"""The choice of a setpoint: by the planner, or without a model the last or the safe rates.

A fixed well that pauses at its time rests in it.
"""

import math
import time
from dataclasses import replace

from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import PUMP_ACCURACY, different_wells
from porotwin_core.rates.wells import WellRates
from porotwin_hub.control.controller import Planner
from porotwin_hub.loop.cycle import Cycle
from porotwin_hub.models.forecast import ModelUnavailable, PhysicsModel
from porotwin_hub.models.plant_knowledge import PlantKnowledge
from porotwin_hub.operator.setpoint_expiry import SetpointDecision, validity


class SetpointChoice:
    """Chooses setpoints by a planner, None: not at all; the history of rates keeps them."""

    def __init__(self, photo_interval: float, rates: RateHistory) -> None:
        """Choose none yet; a setpoint follows every `photo_interval` [s]."""
        self.planner: Planner | None = None
        self.validity = validity(photo_interval)
        self._rates = rates

    def reject(self, cycle: Cycle) -> None:
        """Go on without the setpoint of `cycle`, because the asset did not take it."""
        cycle.accepted = False
        self._rates.take_back(cycle.observation.time)
        if self.planner is not None:
            self.planner.take_back()

    def _commanded(self, planner: Planner, now: float) -> WellRates:
        """Return the rates that a limit on changes counts from at `now` [s]."""
        order = self._rates.order(now)
        return planner.limits.safe() if order is None else order.rates

    def choose(
        self,
        cycle: Cycle,
        physics: PhysicsModel,
        *,
        began: float,
        plant: PlantKnowledge,
    ) -> None:
        """Set the setpoint of `cycle` from its state, and remarks about faults.

        Args:
            cycle: with a state estimate and the rates in force.
            physics: the physics-based model, for one interval.
            began: start of the experiment [s].
            plant: knowledge of pumps and physics; the delay of orders is added here.
        """
        if self.planner is None:
            return
        begin, now = time.perf_counter(), cycle.observation.time
        plant = replace(plant, ahead=self._rates.ahead(now, cycle.pumped))
        chosen = self._planned(cycle, self.planner, physics, began, plant)
        chosen = replace(chosen, rates=dict(self._rates.pauses.at(now, chosen.rates)))
        self._rates.add_commanded(now, chosen.rates, chosen.valid_until)
        cycle.setpoint = chosen
        cycle.durations['optimise'] = time.perf_counter() - begin

    def _planned(
        self,
        cycle: Cycle,
        planner: Planner,
        physics: PhysicsModel,
        began: float,
        plant: PlantKnowledge,
    ) -> SetpointDecision:
        now = cycle.observation.time
        try:
            cycle.decision = planner.decide(
                physics,
                cycle.state,
                self._rates_to_change(cycle, planner, plant),
                now=now - began,
                plant=plant,
            )
        except ModelUnavailable as error:
            cycle.remarks.append(f'not optimised: {error}')
            return self._without_model(planner, now, str(error))
        cycle.remarks += [cycle.decision.remark] if cycle.decision.remark else []
        rates = dict(self._rates.pauses.at(now, cycle.decision.rates))
        reason = planner.objective.goal
        broken = planner.limits.violations(rates, self._commanded(planner, now))
        if broken:  # impossible while `Limits.setpoint` is right; a cheap check of the pumps
            cycle.remarks.append(f'optimised rates refused: {"; ".join(broken)}')
            rates, reason = planner.limits.safe(), 'optimised rates broke a limit'
        return SetpointDecision(rates, now + self.validity, reason)

    def _rates_to_change(self, cycle: Cycle, planner: Planner, plant: PlantKnowledge) -> WellRates:
        """Return the rates that a decision starts from: those in force.

        They are the commanded ones where the pumps are within their accuracy of them, and where
        these will be set before any order of now. A limit on changes counts from setpoint to
        setpoint.
        """
        commanded = self._commanded(planner, cycle.observation.time)
        if plant.ahead.waits or math.isfinite(planner.limits.max_change):
            return commanded
        other = different_wells(cycle.pumped, commanded, accuracy=PUMP_ACCURACY)
        return cycle.pumped if other else commanded

    def _without_model(self, planner: Planner, now: float, reason: str) -> SetpointDecision:
        """Return the setpoint in force while it is valid, afterwards the safe rates.

        One that ends at this very moment is not held: the guard passes none without a duration.
        """
        held = self._rates.order(now)
        if held is not None and now < held.valid_until:
            return SetpointDecision(dict(held.rates), held.valid_until, f'held: {reason}')
        safe = planner.limits.safe()
        return SetpointDecision(safe, now + self.validity, f'safe rates: {reason}')
