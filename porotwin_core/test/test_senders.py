"""Tests of the rules about who may send."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.senders import (
    Sender,
    callers,
    check_senders,
    check_servers,
    goals_of,
    only,
)


@dataclass
class Endpoint:
    node_name: str
    endpoint_gid: list[int]
    topic_type: str = 'own'
    node_namespace: str = '/porotwin'


class Graph:
    """A node that knows all writers; `NAME:TYPE` is one of another type."""

    def __init__(self, *, simulated: bool = False, takes: str = 'own', **writers: str) -> None:
        self.simulated = simulated
        self.writers = writers
        self.takes = takes
        self.asked: list[tuple[str, bool]] = []

    def get_name(self) -> str:
        return 'looking'

    def get_parameter(self, name: str) -> Any:
        assert name == 'use_sim_time'
        return SimpleNamespace(value=self.simulated)

    def get_namespace(self) -> str:
        return '/porotwin'

    def resolve_topic_name(self, name: str) -> str:
        return f'/porotwin/{name}'

    def resolve_service_name(self, name: str) -> str:
        return f'/porotwin/{name}'

    def get_publishers_info_by_topic(self, topic: str, *, no_mangle: bool) -> list[Any]:
        self.asked.append((topic, no_mangle))
        names = self.writers['topic' if topic.startswith('/porotwin') else 'service']
        parts = [name.partition(':') for name in names.split()]
        return [
            Endpoint(name, [number], kind or 'own') for number, (name, _, kind) in enumerate(parts)
        ]

    def get_subscriptions_info_by_topic(self, topic: str, *, no_mangle: bool) -> list[Any]:
        return [Endpoint('looking', [99], self.takes)] if self.takes else []


@pytest.mark.parametrize('kind', ['topic', 'service'])
def test_a_stranger_of_another_type_reaches_nobody(kind: str) -> None:
    def look(graph: Any) -> list[Sender]:
        if kind == 'topic':
            return check_senders(graph, 'wells/setpoint')
        return check_servers(graph, 'guard/control')

    assert [one.node for one in look(Graph(**{kind: 'guard rogue:other'}))] == ['/porotwin/guard']
    assert look(Graph(**{kind: 'guard:other'})) == []
    for graph in (Graph(takes='', **{kind: 'rogue:other'}), Graph(**{kind: 'guard:other rogue'})):
        with pytest.raises(InputError, match='/porotwin/rogue'):
            look(graph)


def test_the_guard_alone_may_publish_setpoints() -> None:
    graph: Any = Graph(topic='guard')
    assert [sender.node for sender in check_senders(graph, 'wells/setpoint')] == ['/porotwin/guard']
    assert set(graph.asked) == {('/porotwin/wells/setpoint', False)}


def test_nobody_sets_a_pump_by_a_recording() -> None:
    replayed: Any = Graph(simulated=True, topic='guard player')
    check_senders(replayed, 'wells/setpoint')
    with pytest.raises(InputError, match='/porotwin/player publishes wells/setpoint too'):
        check_senders(replayed, 'wells/setpoint', replayed=False)


def test_a_twin_in_real_time_takes_nothing_from_a_player() -> None:
    beside: Any = Graph(topic='mend player')
    with pytest.raises(InputError, match='/porotwin/player publishes mend/offer too'):
        check_senders(beside, 'mend/offer')


def test_all_services_of_an_action_have_one_server() -> None:
    class Forged(Graph):
        def get_publishers_info_by_topic(self, topic: str, *, no_mangle: bool) -> list[Any]:
            return [Endpoint('rogue' if 'get_result' in topic else 'costa', [1])]

    graph: Any = Forged()
    with pytest.raises(InputError, match='/porotwin/rogue offers costa/train too'):
        check_servers(graph, goals_of('costa/train'))


def test_another_sender_is_named() -> None:
    graph: Any = Graph(topic='guard rogue')
    with pytest.raises(InputError, match='/porotwin/rogue publishes wells/setpoint too, and only'):
        check_senders(graph, 'wells/setpoint')


def test_a_node_offers_the_services_below_its_own_name() -> None:
    killed_and_restarted: Any = Graph(service='solver solver')
    assert len(set(check_servers(killed_and_restarted, 'solver/predict'))) == 2
    assert set(killed_and_restarted.asked) == {('rr/porotwin/solver/predictReply', True)}
    foreign: Any = Graph(service='solver rogue')
    line = '/porotwin/rogue offers solver/predict too, and only /porotwin/solver may; end it'
    with pytest.raises(InputError, match=line):
        check_servers(foreign, 'solver/predict')


@pytest.mark.parametrize('name', ['operator', 'pumps', 'virtual_rig'])
def test_one_node_of_the_asset_offers_its_services(name: str) -> None:
    alone: Any = Graph(service=name)
    assert [server.node for server in check_servers(alone, 'asset/control')] == [
        f'/porotwin/{name}'
    ]
    two: Any = Graph(service=f'{name} rogue')
    with pytest.raises(InputError, match='/porotwin/rogue offers asset/control too, and only'):
        check_servers(two, 'asset/control')


def test_two_nodes_of_the_asset_do_not_both_answer() -> None:
    two: Any = Graph(service='operator pumps')
    with pytest.raises(InputError, match='several nodes offer asset/control'):
        check_servers(two, 'asset/control')


def test_only_mend_and_a_replay_of_it_offer() -> None:
    replayed: Any = Graph(simulated=True, topic='mend player')
    check_senders(replayed, 'mend/offer')
    rogue: Any = Graph(topic='mend rogue')
    with pytest.raises(InputError, match='/porotwin/rogue publishes mend/offer too, and only'):
        check_senders(rogue, 'mend/offer')


def test_only_the_solver_and_a_replay_of_it_tell_effects() -> None:
    replayed: Any = Graph(simulated=True, topic='solver player')
    check_senders(replayed, 'model/effects')
    rogue: Any = Graph(topic='solver rogue')
    with pytest.raises(InputError, match='/porotwin/rogue publishes model/effects too, and only'):
        check_senders(rogue, 'model/effects')


def test_only_pumps_or_those_who_stand_for_them_measure() -> None:
    several: Any = Graph(simulated=True, topic='pumps operator virtual_rig player')
    check_senders(several, 'wells/measured')
    rogue: Any = Graph(topic='pumps rogue')
    with pytest.raises(InputError, match='/porotwin/rogue publishes wells/measured too'):
        check_senders(rogue, 'wells/measured')


def test_only_a_run_that_is_simulated_or_replayed_keeps_time() -> None:
    for name in ('virtual_rig', 'player'):
        known: Any = Graph(simulated=True, topic=name)
        check_senders(known, '/clock')
    rogue: Any = Graph(topic='rogue')
    with pytest.raises(InputError, match='/porotwin/rogue publishes /clock too'):
        check_senders(rogue, '/clock')


def test_a_program_without_a_name_is_waited_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('porotwin_core.ros.senders.LONGEST_SEARCH_S', 0.2)
    monkeypatch.setattr('porotwin_core.ros.senders._nameless', set())
    graph: Any = Graph(topic='_NODE_NAME_UNKNOWN_')
    looks = []
    for _ in range(3):
        graph.asked.clear()
        with pytest.raises(InputError, match='a program without a name publishes'):
            check_senders(graph, 'wells/measured')
        looks.append(len(graph.asked))
    assert looks[0] > 1
    assert looks[1:] == [1, 1]


def test_two_senders_of_one_name_are_refused() -> None:
    graph: Any = Graph()
    hub, again = Sender('/porotwin/hub', '01'), Sender('/porotwin/hub', '02')
    assert only(graph, [], ['hub'], 'calls') == []
    page = Sender('/porotwin/page', '03')
    assert only(graph, [hub, page], ['hub', 'page'], 'calls') == [hub, page]
    with pytest.raises(InputError, match='2 nodes /porotwin/hub: each calls; if one has just died'):
        only(graph, [hub, again], ['hub'], 'calls')


def test_a_program_without_a_name_is_a_stranger(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('porotwin_core.ros.senders.LONGEST_SEARCH_S', 0.0)
    graph: Any = Graph(service='_NODE_NAME_UNKNOWN_')
    assert callers(graph, 'asset/control')[0].node.endswith('_NODE_NAME_UNKNOWN_')
    with pytest.raises(InputError, match='a program without a name calls asset/control'):
        only(graph, callers(graph, 'asset/control'), ['guard'], 'calls asset/control')
