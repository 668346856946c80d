"""Tests of the hub's node: states and rates in, setpoints, forecasts and reports out."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from hub_examples import SMALL_RIG
from patience import PATIENCE_S, until
from rclpy.parameter import Parameter

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.node_thread import NodeThread
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.hub_node import HubNode
from porotwin_hub.models.forecast import no_correction
from porotwin_msgs.msg import CycleReport, NewState, Setpoint, StateRefreshed
from porotwin_msgs.msg import WellRates as WellRatesMessage
from porotwin_msgs.srv import Control

pytestmark = pytest.mark.graph


class Slope:
    """A model: the tracer grows with the rate of the first control well."""

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        return concentration + 1e-4 * time_step * (1.0 + 1e7 * abs(rates['control1'].rate))

    def correct(self, previous: FloatArray, sigma: FloatArray, rates: Any, step: float) -> Any:
        return self.predict(previous, rates, step) + step * sigma


class Asset:
    """The topics of the asset, and everything that the hub publishes."""

    def __init__(self, context: rclpy.Context) -> None:
        overrides = [
            Parameter('rig', value=str(SMALL_RIG)),
            Parameter('grid', value='20x12'),
            Parameter('evaluations', value=12),
            Parameter('model_timeout_s', value=PATIENCE_S),
            Parameter('use_sim_time', value=True),
        ]
        self.hub = HubNode(
            physics=Slope(),
            data_driven=no_correction,
            context=context,
            parameter_overrides=overrides,
        )
        self.peer = rclpy.create_node('pumps', context=context)
        self.guard = rclpy.create_node('guard', context=context)
        self.imaging = rclpy.create_node('imaging', context=context)
        self.states = self.imaging.create_publisher(NewState, 'asset/new_state', qos.FIELD)
        self.refreshed = self.imaging.create_publisher(
            StateRefreshed, 'asset/state_refreshed', qos.FIELD
        )
        self.measured = self.peer.create_publisher(WellRatesMessage, 'wells/measured', qos.FIELD)
        self.reports: list[CycleReport] = []
        self.setpoints: list[Setpoint] = []
        self.peer.create_subscription(CycleReport, 'hub/cycle', self.reports.append, qos.FIELD)
        self.guard.create_service(Control, 'guard/control', self._on_control)
        self._thread = NodeThread(self.hub, self.peer, self.guard, self.imaging)
        publishers = (self.states, self.refreshed, self.measured)
        until(lambda: all(one.get_subscription_count() for one in publishers))
        until(lambda: self.hub.count_subscribers('hub/cycle') > 0)

    def close(self) -> None:
        self._thread.end()

    def _on_control(self, request: Control.Request, response: Control.Response) -> Control.Response:
        self.setpoints.append(request.setpoint)
        response.outcome = conversions.ok()
        return response

    def emit(self, sequence: int, stamp: float, concentration: FloatArray, grid: Grid) -> None:
        """Publish a state and its refreshed message, and wait for the report."""
        header = conversions.header_at(stamp)
        tracer = conversions.tracer_to_msg(concentration, grid, stamp)
        count = len(self.reports)
        self.states.publish(NewState(header=header, sequence=sequence, tracer=tracer))
        self.refreshed.publish(StateRefreshed(header=header, sequence=sequence))
        until(lambda: len(self.reports) > count)


@pytest.fixture
def asset(domain: int) -> Iterator[Asset]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    made = Asset(context)
    yield made
    made.close()


def test_rates_measured_beside_the_setpoint_reach_the_prediction(
    asset: Asset, small_rig: Rig
) -> None:
    grid = small_rig.grid(20, 12)
    limits = Limits.of(small_rig)
    state = np.full(grid.shape, 0.25)
    asset.emit(1, 30.0, state, grid)
    until(lambda: len(asset.setpoints) == 1)
    assert limits.violations(conversions.rates_from_msg(asset.setpoints[0].wells)) == []
    pumped = limits.setpoint(np.full(3, limits.max_rate / 4))
    asset.measured.publish(
        WellRatesMessage(
            header=conversions.header_at(60.0),
            start=conversions.time_to_msg(30.0),
            wells=conversions.rates_to_msg(pumped),
        )
    )
    assert asset.measured.wait_for_all_acked()
    asset.emit(2, 60.0, Slope().predict(state, pumped, 30.0), grid)
    report = asset.reports[-1]
    assert report.sequence == 2
    assert report.prediction_error < 1e-6  # maps travel as float32
    assert any('predicted again with the rates in force' in line for line in report.remarks)


def test_rates_are_not_used_while_a_foreign_node_could_send_them(
    asset: Asset, small_rig: Rig
) -> None:
    grid = small_rig.grid(20, 12)
    limits = Limits.of(small_rig)
    stranger = rclpy.create_node('stranger', context=asset.peer.context)
    forged = stranger.create_publisher(WellRatesMessage, 'wells/measured', qos.FIELD)
    until(lambda: forged.get_subscription_count() > 0)
    state = np.full(grid.shape, 0.25)
    asset.emit(1, 30.0, state, grid)
    until(lambda: len(asset.setpoints) == 1)
    pumped = conversions.rates_from_msg(asset.setpoints[0].wells)
    wrong = limits.setpoint(np.full(3, limits.max_rate / 10))
    forged.publish(
        WellRatesMessage(
            header=conversions.header_at(60.0),
            start=conversions.time_to_msg(30.0),
            wells=conversions.rates_to_msg(wrong),
        )
    )
    assert forged.wait_for_all_acked()
    asset.emit(2, 60.0, Slope().predict(state, pumped, 30.0), grid)
    report = asset.reports[-1]
    assert report.prediction_error < 1e-6
    assert any('/stranger publishes wells/measured too' in line for line in report.remarks)
    stranger.destroy_node()


def test_nobody_switches_control_off_and_other_changes_are_told(
    asset: Asset, small_rig: Rig
) -> None:
    grid = small_rig.grid(20, 12)
    (refused,) = asset.hub.set_parameters([Parameter('control', value=False)])
    assert not refused.successful
    (taken,) = asset.hub.set_parameters([Parameter('evaluations', value=3)])
    assert taken.successful
    asset.emit(1, 30.0, np.full(grid.shape, 0.25), grid)
    until(lambda: len(asset.setpoints) == 1)
    assert any('was set to 3 while the hub runs' in line for line in asset.reports[0].remarks)


def test_a_state_on_another_grid_is_ignored(asset: Asset, small_rig: Rig) -> None:
    wrong = small_rig.grid(10, 6)
    tracer = conversions.tracer_to_msg(np.zeros(wrong.shape), wrong, 30.0)
    header = conversions.header_at(30.0)
    asset.states.publish(NewState(header=header, sequence=1, tracer=tracer))
    asset.refreshed.publish(StateRefreshed(header=header, sequence=1))
    grid = small_rig.grid(20, 12)
    asset.emit(2, 60.0, np.zeros(grid.shape), grid)
    assert [report.sequence for report in asset.reports] == [2]
