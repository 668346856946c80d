"""The solver node as a process of its own, called over DDS."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from patience import PATIENCE_S, until
from refused_node import refusal

from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import EffectDescription, load_rig
from porotwin_solver.adjoint.schedule_cost import schedule_cost
from porotwin_solver.coefficients.quantities import QUANTITIES
from porotwin_solver.model.model import Model

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from builtin_interfaces.msg import Duration  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402

from porotwin_core.ros import qos  # noqa: E402
from porotwin_core.ros.conversions import (  # noqa: E402
    cost_term_to_msg,
    effect_to_msg,
    header_at,
    plan_to_msg,
    rates_to_msg,
    source_from_msg,
    source_to_msg,
    tracer_from_msg,
    tracer_to_msg,
)
from porotwin_core.ros.vouching import Voucher  # noqa: E402
from porotwin_msgs.msg import Effect, ModelEffects, Outcome, StateRefreshed  # noqa: E402
from porotwin_msgs.srv import (  # noqa: E402
    Cancel,
    Correct,
    CostGradient,
    InitialCondition,
    ModelInfo,
    Ping,
    Predict,
    QuantityOfInterest,
    Residual,
    Rollout,
    SetEffects,
)
from porotwin_solver import solver_node  # noqa: E402

pytestmark = pytest.mark.graph

STEP, LONG = Duration(sec=30), Duration(sec=29_000_000)

SCRIPT = """
from porotwin_core.ros import single_instance
from porotwin_solver.solver_node import main
single_instance.END_S = 0.5  # nobody is being stopped
main()
"""


class Client:
    """Calls the services of one node, one at a time."""

    def __init__(self, namespace: str = '', *, name: str = 'mend') -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node(name, context=self.context, namespace=namespace)
        self.voucher = Voucher(self.node)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def call(self, kind: Any, service: str, /, **fields: Any) -> Any:
        client = self.node.create_client(kind, f'solver/{service}')
        assert client.wait_for_service(PATIENCE_S), f'solver/{service} absent after {PATIENCE_S} s'
        request = kind.Request(**fields)
        self.voucher.vouch(f'solver/{service}', request)
        future = client.call_async(request)
        self.executor.spin_until_future_complete(future, PATIENCE_S)
        assert future.done(), f'solver/{service}: no answer after {PATIENCE_S} s'
        self.node.destroy_client(client)
        return future.result()

    def spin_until(self, condition: Any) -> None:
        until(condition, look=self.executor.spin_once)

    def spin_for(self, seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def start(rig: Path, *more: str) -> subprocess.Popen[str]:
    """Start the node for `rig` on a small grid."""
    arguments = ['--ros-args', '-p', f'rig:={rig}', '-p', 'grid:=31x19', *more]
    return subprocess.Popen(
        [sys.executable, '-c', SCRIPT, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@pytest.fixture(scope='module')
def rig_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('rig') / 'rig.yaml'
    path.write_text(RIG, encoding='utf-8')
    return path


RIG = """
name: small
width_m: 0.934
height_m: 0.562
depth_m: 0.010
porosity: 0.375
permeability_m2: 6.57e-10
viscosity_pa_s: 1.0e-3
density_kg_m3: 998.0
boundaries: {top: open, bottom: closed, left: closed, right: closed}
wells:
  injector: {x_m: 0.235, z_m: 0.235}
  producer: {x_m: 0.660, z_m: 0.160}
  control2: {x_m: 0.500, z_m: 0.375}
effects:
- {name: retardation, parameters: {retardation_factor: 1.02}}
"""


@pytest.fixture(scope='module')
def client(rig_file: Path) -> Iterator[Client]:
    process = start(rig_file, '-p', 'most_cell_updates:=1e12', '-p', 'longest_prediction_s:=3e7')
    client = Client()
    yield client
    assert process.poll() is None, 'the node died from a request'
    client.close()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE_S)


@pytest.fixture
def model(rig_file: Path) -> Model:
    rig = load_rig(rig_file)
    return Model(rig, rig.grid(31, 19), preset='fast')


def test_predictions_equal_those_of_the_model(client: Client, model: Model, rates: Any) -> None:
    state = client.call(InitialCondition, 'initial_condition').state
    commanded = rates_to_msg(rates)
    answer = client.call(Predict, 'predict', previous=state, wells=commanded, time_step=STEP)
    assert answer.outcome.code == Outcome.OK
    predicted, grid = tracer_from_msg(answer.predicted)
    assert grid == model.grid
    expected = model.predict(model.initial_condition(), rates, 30.0)
    np.testing.assert_allclose(predicted, expected, atol=1e-7)  # maps travel as float32
    begin, end = state.header.stamp, answer.predicted.header.stamp
    assert end.sec - begin.sec == 30


def test_correct_undoes_residual_over_the_wire(client: Client, model: Model, rates: Any) -> None:
    observed = np.random.default_rng(1).random(model.grid.shape).astype(np.float32)
    before = np.random.default_rng(2).random(model.grid.shape).astype(np.float32)
    commanded = rates_to_msg(rates)
    previous = tracer_to_msg(before, model.grid, 100.0)
    residual = client.call(
        Residual,
        'residual',
        previous=previous,
        next=tracer_to_msg(observed, model.grid, 130.0),
        wells=commanded,
        time_step=STEP,
    ).residual
    assert np.abs(source_from_msg(residual)[0]).max() > 0.0
    corrected = client.call(
        Correct, 'correct', previous=previous, source=residual, wells=commanded, time_step=STEP
    ).corrected
    np.testing.assert_allclose(tracer_from_msg(corrected)[0], observed, atol=1e-7)


def test_correct_after_predict_equals_the_model_to_the_bit(
    client: Client, model: Model, rates: Any
) -> None:
    """The node uses the prediction again; a model that simulates for `correct` gives the same."""
    before = np.random.default_rng(3).random(model.grid.shape).astype(np.float32)
    sigma = 1e-4 * np.random.default_rng(4).random(model.grid.shape)
    request = {
        'previous': tracer_to_msg(before, model.grid, 100.0),
        'wells': rates_to_msg(rates),
        'time_step': STEP,
    }
    source = source_to_msg(sigma, model.grid, 130.0)
    client.call(Predict, 'predict', **request)
    found = client.call(Correct, 'correct', source=source, **request).corrected
    sent, _ = source_from_msg(source)
    expected = tracer_to_msg(model.correct(before, sent, rates, 30.0), model.grid, 130.0)
    np.testing.assert_array_equal(tracer_from_msg(found)[0], tracer_from_msg(expected)[0])


def test_ping_and_info_describe_the_model(client: Client, model: Model) -> None:
    assert client.call(Ping, 'ping').name == 'solver'
    info = client.call(ModelInfo, 'info')
    assert info.degrees_of_freedom == 31 * 19
    assert info.preset == 'fast'
    assert list(info.wells) == list(model.rig.wells)
    assert list(info.quantities_of_interest) == list(QUANTITIES)
    assert [effect.name for effect in info.effects] == ['retardation']


def test_a_quantity_has_a_value_and_a_unit(client: Client, model: Model) -> None:
    state = tracer_to_msg(np.full(model.grid.shape, 0.5), model.grid, 0.0)
    answer = client.call(
        QuantityOfInterest, 'quantity_of_interest', state=state, name='tracer_volume'
    )
    expected = 0.5 * 0.934 * 0.562 * 0.010 * 0.375 * 1.02
    assert answer.value == pytest.approx(expected, rel=1e-6)
    assert answer.unit == 'm^3'


def test_a_bad_request_gets_its_reason_and_the_node_keeps_running(
    client: Client, model: Model, rates: Any
) -> None:
    empty = tracer_to_msg(model.initial_condition(), model.grid, 0.0)
    holes = tracer_to_msg(np.full(model.grid.shape, np.nan), model.grid, 0.0)
    small = tracer_to_msg(np.zeros((3, 4)), model.rig.grid(4, 3), 0.0)
    wells = rates_to_msg(rates)
    unknown = rates_to_msg({'pump': rates['injector']})
    flood = rates_to_msg({'injector': WellRate(1e300, 1.0)})
    large = tracer_to_msg(np.full(model.grid.shape, 1e30), model.grid, 0.0)
    foreign = tracer_to_msg(model.initial_condition(), model.grid, 0.0)
    foreign.header.frame_id = 'map'
    for fields, text in (
        ({'previous': holes, 'wells': wells, 'time_step': STEP}, '589 cells are not finite'),
        ({'previous': small, 'wells': wells, 'time_step': STEP}, 'the solver runs on 31x19'),
        (
            {'previous': empty, 'wells': wells, 'time_step': Duration()},
            'time step 0.0 s: must be positive',
        ),
        ({'previous': empty, 'wells': unknown, 'time_step': STEP}, "unknown well 'pump'"),
        (
            {'previous': empty, 'wells': wells, 'time_step': Duration(sec=10**9)},
            'the longest one is 3e+07 s',
        ),
        ({'previous': empty, 'wells': wells, 'time_step': Duration(sec=-30)}, 'must be positive'),
        ({'previous': foreign, 'wells': wells, 'time_step': STEP}, "in the frame 'map'"),
        ({'previous': large, 'wells': wells, 'time_step': STEP}, 'with 1e+30 in 589 cells'),
        ({'previous': empty, 'wells': flood, 'time_step': STEP}, 'cell updates, about '),
        (
            {'previous': empty, 'wells': [*wells, wells[0]], 'time_step': STEP},
            'is named twice',
        ),
    ):
        outcome = client.call(Predict, 'predict', **fields).outcome
        assert outcome.code == Outcome.INVALID_INPUT
        assert text in outcome.message
        assert '\n' not in outcome.message
    answer = client.call(
        Correct,
        'correct',
        previous=empty,
        wells=wells,
        time_step=STEP,
        source=source_to_msg(np.full((19, 31), np.nan), model.grid, 0.0),
    )
    assert 'source field: 589 cells are not finite' in answer.outcome.message
    good = client.call(Predict, 'predict', previous=empty, wells=wells, time_step=STEP)
    assert good.outcome.code == Outcome.OK


@pytest.mark.parametrize('cells', [(31, 19), (15, 9)], ids=['own grid', 'coarser grid'])
def test_the_cost_of_a_plan_and_its_gradient_equal_those_of_the_model(
    client: Client, rig_file: Path, rates: Any, cells: tuple[int, int]
) -> None:
    rig = load_rig(rig_file)
    model = Model(rig, rig.grid(*cells), preset='fast')
    plan = [RateStep(0.0, rates), RateStep(60.0, {})]
    terms = [CostTerm(0.0, 120.0, linear=np.ones(model.grid.shape))]
    expected = schedule_cost(model, model.initial_condition(), plan, horizon=120.0, terms=terms)
    fields = {
        'initial': tracer_to_msg(model.initial_condition(), model.grid, 100.0),
        'schedule': plan_to_msg(plan),
        'terms': [cost_term_to_msg(term) for term in terms],
        'horizon': Duration(sec=120),
    }
    answer = client.call(CostGradient, 'cost_gradient', with_gradient=True, **fields)
    assert answer.outcome.code == Outcome.OK, answer.outcome.message
    assert answer.cost == pytest.approx(expected.cost, rel=1e-12)
    assert expected.gradient is not None
    np.testing.assert_allclose(answer.gradient, expected.gradient.ravel(), rtol=1e-12)
    alone = client.call(CostGradient, 'cost_gradient', with_gradient=False, **fields)
    assert (alone.cost, len(alone.gradient)) == (answer.cost, 0)


def test_a_rollout_has_a_state_for_each_time(client: Client, model: Model, rates: Any) -> None:
    initial = tracer_to_msg(model.initial_condition(), model.grid, 100.0)
    plan = plan_to_msg([RateStep(0.0, rates)])
    answer = client.call(
        Rollout, 'rollout', initial=initial, schedule=plan, times=[STEP, Duration(sec=60)]
    )
    assert [state.header.stamp.sec for state in answer.states] == [130, 160]
    expected = model.predict(model.predict(model.initial_condition(), rates, 30.0), rates, 30.0)
    np.testing.assert_allclose(tracer_from_msg(answer.states[1])[0], expected, atol=1e-7)
    fine = tracer_to_msg(np.zeros((20, 40)), model.rig.grid(40, 20), 0.0)
    refused = client.call(Rollout, 'rollout', initial=fine, schedule=plan, times=[STEP])
    assert 'grid 40x20: has more cells than the grid 31x19' in refused.outcome.message


def test_predictions_are_cancelled_and_the_solver_is_free_again(
    client: Client, model: Model, rates: Any
) -> None:
    empty = tracer_to_msg(model.initial_condition(), model.grid, 0.0)
    wells = rates_to_msg(rates)
    service = client.node.create_client(Predict, 'solver/predict')
    assert service.wait_for_service(PATIENCE_S)
    request = Predict.Request(previous=empty, wells=wells, time_step=LONG, token='mine')
    answers = [service.call_async(request) for _ in range(3)]
    for stranger in ('', 'yours'):
        assert client.call(Cancel, 'cancel', token=stranger).cancelled == 0
    cancelled = 0
    while not all(answer.done() for answer in answers):
        cancelled += client.call(Cancel, 'cancel', token='mine').cancelled
    assert cancelled >= len(answers)
    for answer in answers:
        assert answer.result().outcome.code == Outcome.FAILED
        assert answer.result().outcome.message == 'cancelled'
    assert client.call(Cancel, 'cancel', token='mine').cancelled == 0
    good = client.call(Predict, 'predict', previous=empty, wells=wells, time_step=STEP)
    assert good.outcome.code == Outcome.OK
    client.node.destroy_client(service)


def test_effects_act_at_once_and_are_told_and_end(client: Client, model: Model, rates: Any) -> None:
    told: list[ModelEffects] = []
    client.node.create_subscription(ModelEffects, 'model/effects', told.append, qos.CONFIG)
    weak = EffectDescription(name='rate', parameters={'well': 'injector', 'factor': 0.5})
    state = tracer_to_msg(model.initial_condition(), model.grid, 100.0)
    request = {'previous': state, 'wells': rates_to_msg(rates), 'time_step': STEP}
    plain = client.call(Predict, 'predict', **request).predicted
    photograph = StateRefreshed(header=header_at(90.0), sequence=3)
    publisher = client.node.create_publisher(StateRefreshed, 'asset/state_refreshed', qos.FIELD)
    client.spin_until(lambda: told and publisher.get_subscription_count())
    publisher.publish(photograph)
    assert publisher.wait_for_all_acked()

    answer = client.call(SetEffects, 'set_effects', effects=[effect_to_msg(weak)])
    assert answer.outcome.code == Outcome.OK, answer.outcome.message
    client.spin_until(lambda: told[-1].sequence == 1)
    assert str(told[-1]) == str(answer.in_force)  # NaN stands for the number of a text
    assert told[-1].reason == 'mend set: pump injector delivers 50 % of the commanded rate'
    info = client.call(ModelInfo, 'info')
    assert [effect.name for effect in info.effects] == ['retardation', 'rate']
    mended = Model(model.rig, model.grid, preset='fast', effects=[weak])
    expected = mended.predict(model.initial_condition(), rates, 30.0)
    found = client.call(Predict, 'predict', **request).predicted
    np.testing.assert_allclose(tracer_from_msg(found)[0], expected, atol=1e-7)
    plan = plan_to_msg([RateStep(0.0, rates)])
    rolled = client.call(Rollout, 'rollout', initial=state, schedule=plan, times=[STEP])
    np.testing.assert_allclose(tracer_from_msg(rolled.states[0])[0], expected, atol=1e-7)

    lost = Effect(name='leak', parameter_names=['x', 'z', 'rate'])
    lost.parameter_values, lost.parameter_texts = [9.0, 0.1, 5.0], [''] * 3
    refused = client.call(SetEffects, 'set_effects', effects=[lost])
    assert 'lies outside the rig' in refused.outcome.message
    assert str(refused.in_force) == str(told[-1])

    assert client.call(SetEffects, 'set_effects').in_force.sequence == 2
    again = client.call(Predict, 'predict', **request).predicted
    assert again.concentration == plain.concentration


@pytest.fixture
def replayed(rig_file: Path) -> Iterator[Client]:
    """A client of a solver in simulated time."""
    process = start(rig_file, '-r', '__ns:=/replay', '-p', 'use_sim_time:=true')
    client = Client('replay', name='player')
    yield client
    assert process.poll() is None
    client.close()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE_S)


class Player:
    """Publishes effects and the time, as a replay does."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.effects = client.node.create_publisher(ModelEffects, 'model/effects', qos.DECISIONS)
        self.clock = client.node.create_publisher(Clock, '/clock', 1000)
        client.spin_until(
            lambda: self.effects.get_subscription_count() and self.clock.get_subscription_count()
        )

    def decide(self, *names: str, sequence: int) -> None:
        effects = [effect_to_msg(REPLAYED[name]) for name in names]
        self.effects.publish(ModelEffects(sequence=sequence, effects=effects, reason='replayed'))

    def tell_time(self, seconds: int) -> None:
        clock = Clock()
        clock.clock.sec = seconds
        self.clock.publish(clock)

    def leave(self) -> None:
        self.client.node.destroy_publisher(self.effects)
        self.client.node.destroy_publisher(self.clock)


REPLAYED = {
    'rate': EffectDescription(name='rate', parameters={'well': 'injector', 'factor': 0.5}),
    'decay': EffectDescription(name='decay', parameters={'rate': 1e-4}),
}


def acts(client: Client, *names: str) -> bool:
    """Return whether these effects act beyond that of rig.yaml."""
    return [one.name for one in client.call(ModelInfo, 'info').effects] == ['retardation', *names]


def test_effects_of_a_replay_are_followed_and_end_with_its_run(replayed: Client) -> None:
    client = replayed
    assert acts(client)
    first = Player(client)
    first.tell_time(100)
    first.decide('rate', sequence=3)
    client.spin_until(lambda: acts(client, 'rate'))
    first.decide('decay', sequence=1)  # another recording counts its effects anew
    client.spin_until(lambda: acts(client, 'decay'))

    first.tell_time(50)  # the replay starts again
    client.spin_until(lambda: acts(client))
    first.tell_time(100)
    first.decide('rate', sequence=3)
    client.spin_until(lambda: acts(client, 'rate'))

    first.leave()
    second = Player(client)  # a later recording, without effects at its start
    second.tell_time(1000)
    client.spin_until(lambda: acts(client))
    second.decide('rate', sequence=1)
    client.spin_until(lambda: acts(client, 'rate'))


def test_of_many_effects_of_a_replay_the_last_ones_stay(replayed: Client) -> None:
    client = replayed
    player = Player(client)
    player.tell_time(100)
    for sequence in range(1, 12):
        player.decide('rate' if sequence % 2 else 'decay', sequence=sequence)
    player.decide('rate', 'decay', sequence=12)
    client.spin_until(lambda: acts(client, 'rate', 'decay'))
    for _ in range(10):
        client.spin_for(0.1)
        assert acts(client, 'rate', 'decay')


def test_a_second_solver_is_refused_with_one_line(client: Client, rig_file: Path) -> None:
    process = start(rig_file)
    output, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2
    assert 'error: another node /solver runs in this ROS domain; stop it, or set' in output


@pytest.mark.parametrize(
    ('more', 'text'),
    [
        ({'preset': 'quick'}, "error: parameter 'preset' of solver is 'quick'; choose one of"),
        ({'longest_prediction_s': -5.0}, 'is -5; it must be from 1 to 3.1536e+07'),
        ({'grid': 'many'}, "error: grid 'many': write columns x rows, like 187x112"),
    ],
)
def test_a_wrong_parameter_ends_the_node_with_one_line(
    rig_file: Path,
    more: dict[str, object],
    text: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    output = refusal(solver_node.main, monkeypatch, capfd, rig=rig_file, **more)
    assert text in output
