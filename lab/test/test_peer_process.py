"""Peers of the benches: each in a process of its own, which may lack its program, fail or hang."""

import time

import numpy as np
import pytest

from lab.benches import bench_solver
from lab.benches.peers.peer_process import IMAGERS, SOLVERS, Peer, PeerAnswer, run_peer
from porotwin_core.geometry.grid import FloatArray

FAKE = Peer('Fake {}: doubles', 'lab.test.fake_peer', 'fake', 'example.org/fake')


def answer(does: str, limit_s: float = 60.0) -> PeerAnswer:
    return run_peer(FAKE, {'does': np.array(does), 'numbers': np.array([1.0, 2.0])}, limit_s)


def test_an_answer_has_maps_and_what_they_cost() -> None:
    title, maps, processor, wall, memory = answer('doubles')
    assert title == 'Fake 1.2: doubles'
    assert maps is not None
    assert maps.tolist() == [2.0, 4.0]
    assert processor is not None and wall is not None and memory is not None
    assert processor >= 0.0 and wall >= 0.0 and 0.01 < memory < 1.0


def test_a_peer_that_fails_has_one_line_with_the_reason() -> None:
    assert answer('raises') == PeerAnswer(
        'Fake: doubles: ZeroDivisionError: integer division or modulo by zero'
    )


def test_a_peer_that_dies_has_one_line() -> None:
    failed = answer('dies')
    assert failed.maps is None
    assert failed.title.startswith('Fake: doubles: ')
    assert '\n' not in failed.title


def test_a_peer_that_hangs_is_stopped() -> None:
    before = time.monotonic()
    assert answer('hangs', limit_s=3.0) == PeerAnswer('Fake: doubles: stopped after 3 s')
    assert time.monotonic() - before < 60.0  # it would hang for ten minutes


@pytest.mark.parametrize('does', ['leaves', 'spoils'])
def test_a_peer_whose_program_goes_on_or_whose_result_is_damaged_has_one_line(does: str) -> None:
    before = time.monotonic()
    title, maps, *_ = answer(does)
    assert maps is None
    assert '\n' not in title
    assert time.monotonic() - before < 60.0  # what it called would sleep for ten minutes


def test_a_missing_peer_says_where_it_is_to_be_had() -> None:
    missing = Peer('Gone {}', 'no_such_peer', 'no_such_peer', 'example.org/gone')
    assert run_peer(missing, {}).title == 'Gone: not installed (example.org/gone)'


def test_fipy_solves_the_plain_model() -> None:
    pytest.importorskip('fipy', reason='only test environments have FiPy')
    rig, schedule = bench_solver.bench_rig(), bench_solver.bench_schedule()
    grid = rig.grid(24, 14)
    problem = dict(bench_solver.flow_problem(rig, schedule, grid))
    for name in ('inflow', 'tracer', 'outflow'):
        problem[name] = problem[name][:10]
    found = run_peer(SOLVERS[0], problem | {'frames': np.array([10])}).maps
    model = bench_solver.PlainModel(bench_solver.nominal_physics(rig, grid))
    state: FloatArray = np.zeros(grid.shape)
    for frame in range(10):
        state = model.predict(state, schedule.at(30.0 * frame), 30.0)
    assert found is not None
    np.testing.assert_allclose(found[0], state, atol=1e-10)


@pytest.mark.parametrize('peer', [*SOLVERS, *IMAGERS], ids=lambda peer: peer.package)
def test_every_peer_answers_or_has_one_line(peer: Peer) -> None:
    outcome = run_peer(peer, {})
    assert outcome.maps is None  # the problem lacks all arrays
    assert '\n' not in outcome.title and '{' not in outcome.title
