"""The mended twin: an offer is accepted, acts in the solver, and is taken back when it is wrong.

Solver and mend are real processes. The test stands for the camera, the hub and the diagnosis.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from graph import Listener, RunningGraph, running_graph
from rclpy.action import ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from std_msgs.msg import Header

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig, load_rig
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.senders import SENDERS
from porotwin_diagnosis.mending.shadow_forecast import LEAST_WATCHED
from porotwin_hub.launching.graph import NAMESPACE, GraphSettings, twin_nodes
from porotwin_msgs.action import Diagnose
from porotwin_msgs.msg import CycleReport, MendOffer, ModelEffects, NewState, Outcome, WellRates
from porotwin_msgs.srv import AnswerMend, ModelInfo
from porotwin_solver.model.model import Model

pytestmark = pytest.mark.graph

RIG = Path(__file__).resolve().parents[1] / 'porotwin_hub' / 'config' / 'small_rig.yaml'
INTERVAL_S = 60.0
RATES = {
    'injector': WellRate(from_ml_h(500.0), 1.0),
    'producer': WellRate(from_ml_h(-500.0)),
}
DIAGNOSIS = {
    'verdict': 'rate',
    'confidence': 0.97,
    'not_separable_from': [],
    'combination': ['rate'],
    'effects': [
        {'name': 'rate', 'parameters': {'well': {'value': 'injector'}, 'factor': {'value': 0.6}}}
    ],
    'error': {'before': 0.3, 'after': 0.02, 'gap_closed': 0.99},
}


class Laboratory:
    """The camera, the hub and the diagnosis of a rig that is as described."""

    def __init__(self, listener: Listener, rig: Rig, folder: Path) -> None:
        self.listener, self.node = listener, listener.node
        self.grid = rig.grid(31, 19)
        self.model = Model(rig, self.grid, preset='fast')
        self.state = self.model.initial_condition()
        self.time = 0.0
        self.folder = folder
        self.offers: list[MendOffer] = []
        self.effects: list[ModelEffects] = []
        node, group = self.node, ReentrantCallbackGroup()
        node.create_subscription(MendOffer, 'mend/offer', self.offers.append, qos.CONFIG)
        node.create_subscription(ModelEffects, 'model/effects', self.effects.append, qos.CONFIG)
        self.seen: list[Header] = []
        node.create_subscription(Header, 'mend/seen', self.seen.append, qos.FIELD)
        self.states, self.cycles, self.measured = (
            rclpy.create_node(
                SENDERS[topic][0], namespace=NAMESPACE, context=node.context
            ).create_publisher(kind, topic, qos.FIELD)
            for topic, kind in (
                ('asset/new_state', NewState),
                ('hub/cycle', CycleReport),
                ('wells/measured', WellRates),
            )
        )
        self.info = node.create_client(ModelInfo, 'solver/info')
        diagnosis = rclpy.create_node('diagnosis', namespace=NAMESPACE, context=node.context)
        listener.spin(diagnosis)
        self.diagnosis = ActionServer(
            diagnosis, Diagnose, 'diagnosis/diagnose', self._diagnose, callback_group=group
        )

    def _diagnose(self, goal: Any) -> Diagnose.Result:
        (self.folder / 'diagnosis.json').write_text(json.dumps(DIAGNOSIS))
        goal.succeed()
        return Diagnose.Result(verdict='rate', report=str(self.folder / 'report.html'))

    def wait(self, purpose: str, condition: Callable[[], bool]) -> None:
        self.listener.wait_for(purpose, condition)

    def photograph(self) -> None:
        """Pump for an interval, and publish rates, map and report."""
        begin, self.time = self.time, self.time + INTERVAL_S
        self.state = self.model.predict(self.state, RATES, INTERVAL_S)
        header = conversions.header_at(self.time)
        start = conversions.time_to_msg(begin)
        wells = conversions.rates_to_msg(RATES)
        self.measured.publish(WellRates(header=header, start=start, wells=wells))
        tracer = conversions.tracer_to_msg(self.state, self.grid, self.time)
        self.states.publish(NewState(header=header, tracer=tracer))
        self.cycles.publish(
            CycleReport(header=header, prediction_error=0.02, expected_error=np.nan)
        )
        self.wait('mend to see the photograph', lambda: header in self.seen)

    def forged_answer(self, sequence: int) -> str:
        """Accept an offer as a stranger; return the refusal."""
        client = self.node.create_client(AnswerMend, 'mend/answer')
        self.wait('the mend node', client.service_is_ready)
        future = client.call_async(AnswerMend.Request(sequence=sequence, accept=True))
        self.wait('a refusal', future.done)
        self.node.destroy_client(client)
        return str(future.result().outcome.message)

    def answer(self, sequence: int, *, accept: bool) -> Outcome:
        request = AnswerMend.Request(sequence=sequence, accept=accept)
        answer = self.listener.answer('terminal', AnswerMend, 'mend/answer', request)
        return answer.outcome

    def effects_of_the_solver(self) -> list[str]:
        future = self.info.call_async(ModelInfo.Request())
        self.wait('the effects of the solver', future.done)
        return [effect.name for effect in future.result().effects]


@pytest.fixture
def laboratory(tmp_path: Path, domain: int) -> Iterator[tuple[RunningGraph, Laboratory]]:
    settings = GraphSettings(
        rig=RIG, grid='31x19', diagnoses=tmp_path, mend='ask', use_sim_time=True
    )
    nodes = [node for node in twin_nodes(settings) if node.name in ('solver', 'mend')]
    with running_graph(nodes, tmp_path, domain) as graph:
        yield graph, Laboratory(graph.listener, load_rig(RIG), tmp_path)


@pytest.mark.timeout(240)
def test_an_offer_acts_when_accepted_and_is_taken_back_when_photographs_disagree(
    laboratory: tuple[RunningGraph, Laboratory],
) -> None:
    graph, lab = laboratory
    lab.wait('mend and solver', lambda: lab.info.service_is_ready() and bool(lab.effects))
    lab.wait('mend to listen', lambda: lab.cycles.get_subscription_count() > 0)
    lab.wait('mend to see maps', lambda: lab.states.get_subscription_count() > 0)
    lab.wait('mend to tell', lambda: lab.node.count_publishers('mend/seen') > 0)
    for _ in range(22):
        lab.photograph()
    lab.wait('an offer', lambda: bool(lab.offers))
    assert lab.offers[0].sentence == (
        'Pump injector delivers 60 % of the commanded rate: with it the model errs by 2 % instead '
        'of 30 %.'
    )
    assert 'only /porotwin/page or terminal may' in lab.forged_answer(1)
    assert lab.effects_of_the_solver() == []
    assert 'does not exist' in lab.answer(7, accept=True).message
    assert lab.answer(1, accept=True).code == Outcome.OK
    assert lab.effects_of_the_solver() == ['rate']
    assert 'offer 1 is accepted already' in lab.answer(1, accept=False).message

    for _ in range(LEAST_WATCHED + 2):
        lab.photograph()
    lab.wait('it is taken back', lambda: lab.offers[-1].state == MendOffer.TAKEN_BACK)
    assert lab.effects_of_the_solver() == []
    lab.wait('the solver to tell', lambda: lab.effects[-1].sequence == 2)
    assert lab.effects[-1].reason == 'mend set: the model as rig.yaml describes it'

    lab.diagnosis.destroy()
    for _ in range(22):
        lab.photograph()
    graph.wait_for_log('mend', 'no diagnosis: its node does not run')
