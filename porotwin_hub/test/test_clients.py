"""Tests of service calls: a call that takes too long is cancelled."""

import threading
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
import rclpy
from patience import PATIENCE_S
from rclpy.callback_groups import ReentrantCallbackGroup

from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS
from porotwin_core.rates.wells import RateStep
from porotwin_core.rig import Rig
from porotwin_core.ros import conversions
from porotwin_core.ros.node_thread import NodeThread
from porotwin_hub.models.clients import Caller, PhysicsModelClient, PlanModelClient
from porotwin_hub.models.forecast import ModelUnavailable
from porotwin_msgs.srv import Cancel, CostGradient, Predict

pytestmark = pytest.mark.graph


class SlowSolver:
    """A solver whose predictions end only when they are cancelled, and answer `field`."""

    def __init__(self, context: rclpy.Context) -> None:
        self.node = rclpy.create_node('solver', context=context)
        self.cancelled = threading.Event()
        self.field: Any = None
        self.token = ''
        group = ReentrantCallbackGroup()
        self.node.create_service(Predict, 'solver/predict', self._predict, callback_group=group)
        self.node.create_service(Cancel, 'solver/cancel', self._cancel, callback_group=group)
        self._thread = NodeThread(self.node, threads=4)

    def close(self) -> None:
        self._thread.end()

    def _predict(self, request: Any, response: Any) -> Any:
        self.token = request.token
        if self.field is None:
            self.cancelled.wait(PATIENCE_S)
        else:
            response.predicted = self.field
        return response

    def _cancel(self, request: Any, response: Any) -> Any:
        if request.token and request.token == self.token:
            self.cancelled.set()
        return response


@pytest.fixture
def solver(domain: int) -> Iterator[SlowSolver]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    made = SlowSolver(context)
    yield made
    made.close()


def test_a_prediction_that_takes_too_long_is_cancelled(solver: SlowSolver, small_rig: Rig) -> None:
    grid = small_rig.grid(4, 3)
    call = Caller(solver.node, timeout=0.5)
    model = PhysicsModelClient(call, grid)
    with pytest.raises(ModelUnavailable, match=r"'solver/predict' did not answer within 0.5 s"):
        model.predict(np.zeros(grid.shape), {}, 30.0)
    assert solver.cancelled.wait(PATIENCE_S)


def test_an_answer_is_not_believed_while_another_node_could_have_given_it(
    solver: SlowSolver, small_rig: Rig
) -> None:
    grid = small_rig.grid(4, 3)
    solver.field = conversions.tracer_to_msg(np.zeros(grid.shape), grid, 0.0)
    model = PhysicsModelClient(Caller(solver.node, timeout=PATIENCE_S), grid)
    rogue = rclpy.create_node('rogue', context=solver.node.context)
    service = rogue.create_service(Predict, 'solver/predict', lambda _, response: response)
    with pytest.raises(ModelUnavailable, match='/rogue offers solver/predict too, and only /solv'):
        model.predict(np.zeros(grid.shape), {}, 30.0)
    rogue.destroy_service(service)
    assert model.predict(np.zeros(grid.shape), {}, 30.0).shape == grid.shape


@pytest.mark.parametrize(
    ('name', 'complaint'),
    [
        ('rogue', '/rogue offers solver/predict too'),
        ('solver', 'was started again while it worked'),
    ],
)
def test_a_node_that_comes_while_the_solver_works_ends_the_wait(
    solver: SlowSolver, small_rig: Rig, name: str, complaint: str
) -> None:
    grid = small_rig.grid(4, 3)
    model = PhysicsModelClient(Caller(solver.node, timeout=10 * PATIENCE_S), grid)
    node = rclpy.create_node(name, context=solver.node.context)
    offer = partial(node.create_service, Predict, 'solver/predict', lambda _, response: response)
    threading.Timer(1.0, offer).start()
    with pytest.raises(ModelUnavailable, match=complaint):
        model.predict(np.zeros(grid.shape), {}, 30.0)


def test_an_answer_that_is_no_concentration_is_refused(solver: SlowSolver, small_rig: Rig) -> None:
    grid = small_rig.grid(4, 3)
    solver.field = conversions.tracer_to_msg(np.full(grid.shape, 1e30), grid, 0.0)
    model = PhysicsModelClient(Caller(solver.node, timeout=PATIENCE_S), grid)
    with pytest.raises(ModelUnavailable, match="'solver/predict' answers wrongly: tracer field"):
        model.predict(np.zeros(grid.shape), {}, 30.0)


def test_a_prediction_without_a_number_in_a_cell_is_refused(small_rig: Rig) -> None:
    grid = small_rig.grid(4, 3)
    field = np.zeros(grid.shape)
    field[1, 2] = np.nan  # unseen cells are for photographs only

    def service(*_: Any, **__: Any) -> Any:
        return Predict.Response(predicted=conversions.tracer_to_msg(field, grid, 0.0))

    call: Any = service
    with pytest.raises(ModelUnavailable, match="'solver/predict' answers wrongly: not finite"):
        PhysicsModelClient(call, grid).predict(np.zeros(grid.shape), {}, 30.0)


class PlanService:
    """A solver whose derivatives are all `derivative`; it is called as a `Caller`."""

    def __init__(self, derivative: float, wells: int) -> None:
        self.response = CostGradient.Response(cost=1.0, gradient=[derivative] * wells)

    def __call__(self, *_: Any, **__: Any) -> CostGradient.Response:
        return self.response


@pytest.mark.parametrize('derivative', [float('nan'), float('inf')])
def test_a_gradient_that_is_not_finite_is_refused(small_rig: Rig, derivative: float) -> None:
    service: Any = PlanService(derivative, len(small_rig.wells))
    with pytest.raises(ModelUnavailable, match="'solver/cost_gradient' answers wrongly: not fin"):
        PlanModelClient(service, small_rig).plan_cost(
            np.zeros((3, 4)),
            [RateStep(0.0, {})],
            horizon=30.0,
            terms=[],
            with_gradient=True,
            learnt=NO_LEARNT_PHYSICS,
            patience=1.0,
        )
