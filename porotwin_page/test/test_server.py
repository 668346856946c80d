"""Tests of the server over HTTP on loopback, without a graph."""

import asyncio
import contextlib
import json
import os
import socket
import threading
import urllib.request
from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from aiohttp import ClientResponse, ClientSession, ClientTimeout
from aiohttp.test_utils import TestClient, TestServer
from page_examples import (
    RIG,
    START,
    TOKEN,
    expectation,
    ml_h,
    observed_state,
    point,
    rates,
    two_cycles,
)

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import WellRates
from porotwin_core.ros.foreign_words import FEW
from porotwin_page import graph_snapshot as snapshot
from porotwin_page import server
from porotwin_page.access import Access
from porotwin_page.address import listen
from porotwin_page.confirmation import Confirmation
from porotwin_page.expectation import Expectation
from porotwin_page.past_states import PastStates
from porotwin_page.server import (
    MAX_CONFIRMATION,
    ConfirmationUnavailable,
    PageApplication,
    ServerThread,
    SiblingsUnavailable,
    StreamSettings,
)
from porotwin_page.snapshot_store import SnapshotStore
from porotwin_page.web_files import web_files

BEARER = {'Authorization': f'Bearer {TOKEN}'}
JSON_TYPE = {'Content-Type': 'application/json', **BEARER}
AS_SHOWN = {'sequence': 2, 'rates_ml_h': ml_h(rates(120.0))}


class Scene:
    """A store, a server for it, and the confirmations that it received."""

    def __init__(self, settings: StreamSettings | None = None) -> None:
        self.store = SnapshotStore()
        self.store.update(lambda _: two_cycles())
        self.confirmed: list[Confirmation] = []
        self.asked: list[WellRates] = []
        self.answering = threading.Event()
        self.answering.set()
        self.refusal: Exception | None = None
        self.past = PastStates()
        self.application = PageApplication(
            self.store,
            self.confirm,
            lambda: START + 40.0,
            Access(TOKEN, frozenset({'lab-pc'})),
            ask=self.ask,
            past=self.past,
            settings=settings,
        )

    def ask(self, rates: WellRates) -> Expectation:
        if self.refusal is not None:
            raise self.refusal
        self.asked.append(rates)
        self.answering.wait(10)
        return expectation(0.5)

    def confirm(self, given: Confirmation) -> str:
        if self.refusal is not None:
            raise self.refusal
        self.confirmed.append(given)
        return f'setpoint {given.sequence} confirmed'


def with_client(
    work: Callable[[Scene, TestClient], Any], settings: StreamSettings | None = None
) -> None:
    """Run `work` against a new scene."""

    async def go() -> None:
        scene = Scene(settings)
        async with TestClient(TestServer(scene.application.make())) as client:
            await asyncio.wait_for(work(scene, client), 30)
        scene.past.close()

    asyncio.run(go())


async def next_event(response: ClientResponse) -> dict:
    while True:
        line = await response.content.readuntil(b'\n')
        if line.startswith(b'data: '):
            return json.loads(line[6:])


@contextlib.asynccontextmanager
async def stream(client: TestClient | ClientSession, url: str = '/events') -> AsyncIterator[Any]:
    async with client.get(url, timeout=ClientTimeout(None)) as response:
        yield response


def test_the_page_and_its_files_are_served_and_load_nothing_else() -> None:
    async def work(_: Scene, client: TestClient) -> None:
        response = await client.get('/')
        assert response.content_type == 'text/html'
        policy = response.headers['Content-Security-Policy']
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        for path, (text, content_type) in web_files().items():
            response = await client.get(f'/{path}')
            assert response.content_type == content_type
            assert await response.text() == text

    with_client(work)


@pytest.mark.parametrize('path', ['web/other.js', 'panels/pump_settings.py', 'web/..%2fserver.py'])
def test_other_files_are_not_served(path) -> None:
    async def work(_: Scene, client: TestClient) -> None:
        assert (await client.get(f'/{path}')).status == 404

    with_client(work)


def test_the_report_on_an_offer_is_served_and_no_other_file(tmp_path: Path) -> None:
    report, other = tmp_path / 'report.html', tmp_path / 'other.html'
    for file in (report, other):
        file.write_text('<p>a leak</p>')

    async def work(scene: Scene, client: TestClient) -> None:
        assert (await client.get('/report')).status == 404
        for path, status in ((report, 200), (other, 404), (tmp_path / 'x' / 'report.html', 404)):
            offer = snapshot.MendOffer(1, 'offered', True, START, 0.9, 'a leak', str(path))
            scene.store.update(replace, offer=offer)
            response = await client.get('/report')
            assert response.status == status
            assert ('a leak' in await response.text()) is (status == 200)
            policy = response.headers['Content-Security-Policy']
            assert "default-src 'none'" in policy
            assert 'sandbox' in policy or status == 404

    with_client(work)


def test_a_file_that_is_no_file_is_not_served_and_stops_nothing(tmp_path: Path) -> None:
    fifo = tmp_path / 'report.html'
    os.mkfifo(fifo)

    async def work(scene: Scene, client: TestClient) -> None:
        for path in (fifo, tmp_path / 'linked' / 'report.html', tmp_path / 'folder/report.html'):
            path.parent.mkdir(exist_ok=True)
            if path.parent.name == 'folder':
                path.mkdir()
            elif path is not fifo:
                path.symlink_to('/dev/zero')
            offer = snapshot.MendOffer(1, 'offered', True, START, 0.9, 'a leak', str(path))
            scene.store.update(replace, offer=offer)
            async with asyncio.timeout(20.0):
                answers = await asyncio.gather(*(client.get('/report') for _ in range(20)))
                assert [answer.status for answer in answers] == [404] * 20
                assert (await client.get('/map/observed.png')).status == 200
        assert scene.application.workers.busy_for == 0.0

    with_client(work)


def test_events_begin_with_everything_and_go_on_with_what_is_new() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        async with stream(client) as response:
            assert response.content_type == 'text/event-stream'
            first = await next_event(response)
            assert first['panels']['pump_settings']['remaining_s'] == pytest.approx(80.0)
            assert first['history']['reset']
            assert len(first['history']['points']) == 2
            scene.store.update(snapshot.with_cycle, point(3))
            while (second := await next_event(response))['history']['end'] < 3:
                pass
            assert not second['history']['reset']
            assert second['history']['begin'] == 2
            assert [entry['time_s'] for entry in second['history']['points']] == [START + 60.0]

    with_client(work)


def test_events_come_at_least_every_second_when_nothing_changes() -> None:
    async def work(_: Scene, client: TestClient) -> None:
        async with stream(client) as response:
            ages = [(await next_event(response))['header']['photo']['age_s'] for _ in range(3)]
            assert ages[0] < ages[1] < ages[2]

    with_client(work)


def test_several_browsers_receive_the_same() -> None:
    async def work(_: Scene, client: TestClient) -> None:
        async with stream(client) as one, stream(client) as other:
            first, second = await next_event(one), await next_event(other)
            assert first['panels'] == second['panels']
            assert first['history'] == second['history']

    with_client(work)


def test_browsers_are_counted_until_they_leave() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        async with stream(client) as response:
            await next_event(response)
            assert scene.application.streams == 1
        while scene.application.streams:
            await asyncio.sleep(0.05)

    with_client(work)


def test_browsers_beyond_the_limit_are_refused() -> None:
    async def work(_: Scene, client: TestClient) -> None:
        async with stream(client) as response:
            await next_event(response)
            refused = await client.get('/events')
            assert refused.status == 503
            assert 'served already' in await refused.text()

    with_client(work, StreamSettings(limit=1))


def test_a_browser_that_does_not_read_delays_nobody_and_is_disconnected() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        # a long message fills the buffers of a connection quickly
        crowded = snapshot.Health(snapshot.Level.OK, 'x' * 200_000, 0.0)
        scene.store.update(snapshot.with_health, 'hub', crowded)
        host, port = client.host, client.port
        sleeping = socket.create_connection((host, port))
        try:
            sleeping.sendall(b'GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n')
            while scene.application.streams == 0:
                await asyncio.sleep(0.01)
            answered = await client.get('/map/observed.png')
            assert answered.status == 200
            while scene.application.streams:
                await asyncio.sleep(0.05)
        finally:
            sleeping.close()

    with_client(work, StreamSettings(check_period=0.001, heartbeat=0.0, send_timeout=0.3))


def test_maps_are_png_and_absent_ones_are_404() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        for kind in ('observed', 'forecast', 'difference'):
            for place in ('map', 'scale'):
                response = await client.get(f'/{place}/{kind}.png?theme=dark')
                assert response.status == 200
                assert (await response.read()).startswith(b'\x89PNG')
        assert (await client.get('/map/secret.png')).status == 404
        assert (await client.get('/map/observed.png?theme=pink')).status == 404
        scene.store.update(snapshot.with_new_experiment, START + 600.0)
        gone = await client.get('/map/observed.png')
        assert gone.status == 404
        assert 'no observed map yet' in await gone.text()

    with_client(work)


def test_a_confirmation_names_the_setpoint_that_was_shown() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        response = await client.post('/confirm', json=AS_SHOWN, headers=BEARER)
        assert response.status == 200
        assert await response.json() == {'message': 'setpoint 2 confirmed'}
        (given,) = scene.confirmed
        assert given.sequence == 2
        assert given.rates == rates(120.0)

    with_client(work)


def test_odd_rates_are_answered_with_a_question_and_recorded_after_a_yes() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        body = {'sequence': 2, 'rates_ml_h': {**AS_SHOWN['rates_ml_h'], 'control1': 470.0}}
        response = await client.post('/confirm', json=body, headers=BEARER)
        assert response.status == 409
        assert '350 ml/h more is injected than produced' in (await response.json())['question']
        assert scene.confirmed == []
        response = await client.post('/confirm', json={**body, 'sure': True}, headers=BEARER)
        assert response.status == 200
        assert len(scene.confirmed) == 1

    with_client(work)


@pytest.mark.parametrize(
    ('headers', 'status'),
    [
        ({}, 403),
        ({'Authorization': 'Bearer'}, 403),
        ({'Authorization': 'Bearer k7mq-3xwd-p9rb'}, 403),
        ({'Authorization': f'Bearer {TOKEN}x'}, 403),
        ({**BEARER, 'Origin': 'http://elsewhere.example'}, 403),
        ({**BEARER, 'Origin': 'null'}, 403),
        ({**BEARER, 'Origin': 'http://localhost:1'}, 403),
        ({**BEARER, 'Origin': 'OWN'}, 200),
        (BEARER, 200),
    ],
)
def test_a_confirmation_needs_the_token_and_comes_from_the_page_itself(headers, status) -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        own = f'http://{client.host}:{client.port}'
        given = {key: own if value == 'OWN' else value for key, value in headers.items()}
        response = await client.post('/confirm', json=AS_SHOWN, headers=given)
        assert response.status == status
        assert len(scene.confirmed) == (status == 200)
        if status == 403:
            assert '\n' not in (await response.json())['error']

    with_client(work)


@pytest.mark.parametrize(
    ('host', 'status'),
    [
        ('127.0.0.1', 200),
        ('localhost:9000', 200),
        ('[::1]:80', 200),
        ('LAB-PC:8765', 200),
        ('evil.example', 403),
        ('evil.example:8765', 403),
        ('127.0.0.1.evil.example', 403),
        ('192.0.2.7', 403),
        ('localhost@evil.example', 403),
        ('[::1', 403),
    ],
)
def test_a_request_under_another_name_is_refused_in_one_line(host, status) -> None:
    async def work(_: Scene, client: TestClient) -> None:
        for path in ('/', '/web/page.js', '/map/observed.png', '/past?state=1'):
            response = await client.get(path, headers={'Host': host})
            assert response.status in ((403,) if status == 403 else (200, 404))
            if status == 403:
                assert 'is not a name of this page' in (await response.json())['error']

    with_client(work)


def test_every_answer_forbids_keeping_and_framing() -> None:
    async def work(_: Scene, client: TestClient) -> None:
        for path in ('/', '/nothing', '/map/observed.png'):
            response = await client.get(path)
            assert response.headers['Cache-Control'] == 'no-store'
            assert "frame-ancestors 'none'" in response.headers['Content-Security-Policy']
            assert 'unsafe' not in response.headers['Content-Security-Policy']

    with_client(work)


@pytest.mark.parametrize(
    ('body', 'headers', 'status', 'words'),
    [
        (b'{', JSON_TYPE, 400, 'not JSON'),
        (b'[' * 9000, JSON_TYPE, 400, 'not JSON'),
        (b'[]', JSON_TYPE, 400, 'JSON object'),
        (b'{"sequence": 7}', JSON_TYPE, 400, 'setpoint 7'),
        (b'{"sequence": NaN}', JSON_TYPE, 400, 'NaN'),
        (b' ' * (MAX_CONFIRMATION + 1), JSON_TYPE, 413, 'longer than'),
        (b'{}', {**BEARER, 'Content-Type': 'text/plain'}, 415, 'application/json'),
        (b'{}', {**BEARER, 'Content-Type': 'application/json; charset=none'}, 400, 'whole number'),
    ],
)
def test_a_wrong_confirmation_is_answered_with_one_line(body, headers, status, words) -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        response = await client.post('/confirm', data=body, headers=headers)
        assert response.status == status
        error = (await response.json())['error']
        assert words in error
        assert '\n' not in error
        assert scene.confirmed == []

    with_client(work)


@pytest.mark.parametrize(
    ('refusal', 'status'),
    [(InputError('setpoint 2 is not known'), 400), (ConfirmationUnavailable('nobody there'), 503)],
)
def test_a_refusal_of_the_graph_reaches_the_browser(refusal, status) -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        scene.refusal = refusal
        response = await client.post('/confirm', json=AS_SHOWN, headers=BEARER)
        assert response.status == status
        assert (await response.json())['error'] == str(refusal)

    with_client(work)


def test_values_of_a_map_are_served_as_numbers() -> None:
    async def work(_: Scene, client: TestClient) -> None:
        response = await client.get('/values/observed')
        rows, columns = map(int, response.headers['X-Shape'].split())
        values = np.frombuffer(await response.read(), '<f4').reshape(rows, columns)
        np.testing.assert_allclose(values, 0.45, atol=1e-6)

    with_client(work)


def test_an_earlier_state_is_served_as_if_it_were_the_newest() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        scene.past.add(scene.store.snapshot)
        scene.store.update(snapshot.with_observed_state, observed_state(3, value=0.7))
        scene.past.add(scene.store.snapshot)
        async with stream(client) as response:
            assert (await next_event(response))['states'] == {'first': 1, 'last': 2}
        earlier = await (await client.get('/past?state=1')).json()
        assert earlier['sequence'] == 2
        assert earlier['time_s'] == START + 30.0
        assert earlier['panels'].keys() == {'observed', 'forecast', 'difference'}
        assert earlier['rates_ml_h']['control1'] == 120.0
        for panel, value in (('observed', 0.45), ('forecast', 0.25), ('difference', 0.2)):
            values = await (await client.get(f'/values/{panel}?state=1')).read()
            np.testing.assert_allclose(np.frombuffer(values, '<f4'), value, atol=1e-3)
            assert (await client.get(f'/map/{panel}.png?state=1')).status == 200
        for wrong in ('0', '3', '-1', 'x', '9' * 400, ''):
            assert (await client.get(f'/past?state={wrong}')).status == 404

    with_client(work)


def test_an_event_has_only_the_panels_that_changed() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        async with stream(client) as response:
            first = await next_event(response)
            assert first['panels'].keys() >= {'observed', 'pump_settings', 'setpoint_log'}
            scene.store.update(replace, rig=RIG)
            assert (await next_event(response))['panels'].keys() == set()

    with_client(work)


def test_the_server_runs_in_its_own_thread_and_frees_its_port_with_streams_open() -> None:
    scene = Scene()
    listening = listen('127.0.0.1:0')
    port = listening.getsockname()[1]
    running = ServerThread(scene.application.make(), listening)
    with urllib.request.urlopen(f'http://127.0.0.1:{port}/events', timeout=10) as response:
        assert response.readline().startswith(b'data: ')
        running.close()
    listen(f'127.0.0.1:{port}').close()
    assert not any(thread.name == 'page' for thread in threading.enumerate())


PROPOSED = {'rates_ml_h': {'control1': 250}}


def test_a_proposal_is_answered_with_what_to_expect() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        async with client.post('/what-if', json=PROPOSED, headers=BEARER) as response:
            assert response.status == 200
            assert (await response.json())['zone_ml']['median'] == [0.5, 1.0]
        assert list(scene.asked[0]) == ['control1']
        assert scene.confirmed == []

    with_client(work)


def test_a_question_needs_the_token_and_the_pages_own_site() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        foreign = {**BEARER, 'Origin': 'http://elsewhere.example'}
        for headers in ({}, foreign):
            async with client.post('/what-if', json=PROPOSED, headers=headers) as response:
                assert response.status == 403
        assert scene.asked == []

    with_client(work)


def test_one_question_is_answered_at_a_time() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        scene.answering.clear()
        first = asyncio.create_task(client.post('/what-if', json=PROPOSED, headers=BEARER))
        while not scene.asked:
            await asyncio.sleep(0.01)
        async with client.post('/what-if', json=PROPOSED, headers=BEARER) as response:
            assert response.status == 429
        scene.answering.set()
        assert (await first).status == 200

    with_client(work)


@pytest.mark.parametrize(
    ('refusal', 'status'),
    [(SiblingsUnavailable('nobody can tell'), 503), (InputError('no photograph yet'), 400)],
)
def test_why_there_is_no_answer_is_told(refusal: Exception, status: int) -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        scene.refusal = refusal
        async with client.post('/what-if', json=PROPOSED, headers=BEARER) as response:
            assert response.status == status
            assert (await response.json())['error'] == str(refusal)

    with_client(work)


def test_a_question_beyond_the_limits_is_refused() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        beyond = {'rates_ml_h': {'control1': 900}}
        async with client.post('/what-if', json=beyond, headers=BEARER) as response:
            assert response.status == 400
        assert scene.asked == []

    with_client(work)


def test_a_compressed_request_is_refused_unread_and_silent_connections_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(server, 'PATIENCE_S', 0.3)
    listening = listen('127.0.0.1:0')
    port = listening.getsockname()[1]
    running = ServerThread(Scene().application.make(), listening)
    with contextlib.closing(running):
        silent = socket.create_connection(('127.0.0.1', port), timeout=10.0)
        slow = socket.create_connection(('127.0.0.1', port), timeout=10.0)
        slow.sendall(b'GET / HTTP/1.1\r\nHost:')
        kept = HTTPConnection('127.0.0.1', port, timeout=10.0)
        for packed, status in ((False, 200), (True, 415)):
            kept.request('GET', '/', headers={'Content-Encoding': 'br'} if packed else {})
            answer = kept.getresponse()
            assert answer.status == status
            answer.read()
        assert kept.sock is not None
        for connection in (silent, slow, kept.sock):
            assert connection.recv(1) == b''  # the page has ended it
            connection.close()


def test_bytes_that_are_no_request_cost_a_few_plain_lines(
    caplog: pytest.LogCaptureFixture,
) -> None:
    listening = listen('127.0.0.1:0')
    address = listening.getsockname()
    with contextlib.closing(ServerThread(Scene().application.make(), listening)):
        for number in range(20):
            with socket.create_connection(address, timeout=10.0) as connection:
                odd = f'GET /\x1b[2J{number} HTTP/9\r\n'.encode() + b'\xff: \x07\r\n\r\n'
                connection.sendall(odd)
                assert b' 400 ' in connection.recv(100)
    assert 0 < len(caplog.records) <= FEW
    assert all(line.isprintable() for line in caplog.messages)
    assert not any(record.exc_info for record in caplog.records)
