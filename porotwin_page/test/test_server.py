"""Tests of the server over HTTP on loopback, without a graph."""

import asyncio
import contextlib
import json
import socket
import threading
import urllib.request
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from aiohttp import ClientResponse, ClientSession, ClientTimeout
from aiohttp.test_utils import TestClient, TestServer
from page_examples import START, point, two_cycles

from porotwin_core.errors import InputError
from porotwin_page import graph_snapshot as snapshot
from porotwin_page.address import listen
from porotwin_page.confirmation import Confirmation
from porotwin_page.server import (
    ConfirmationUnavailable,
    PageApplication,
    ServerThread,
    StreamSettings,
)
from porotwin_page.snapshot_store import SnapshotStore
from porotwin_page.web_files import web_files

JSON_TYPE = {'Content-Type': 'application/json'}


class Scene:
    """A store, a server for it, and the confirmations that it received."""

    def __init__(self, settings: StreamSettings | None = None) -> None:
        self.store = SnapshotStore()
        self.store.update(lambda _: two_cycles())
        self.confirmed: list[Confirmation] = []
        self.refusal: Exception | None = None
        self.application = PageApplication(
            self.store, self.confirm, lambda: START + 40.0, settings=settings
        )

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
            sleeping.sendall(b'GET /events HTTP/1.1\r\nHost: page\r\n\r\n')
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
        body = {'sequence': 2, 'rates_ml_h': {'control1': 118.0}}
        response = await client.post('/confirm', json=body)
        assert response.status == 200
        assert await response.json() == {'message': 'setpoint 2 confirmed'}
        (given,) = scene.confirmed
        assert given.sequence == 2
        assert list(given.rates) == ['control1']

    with_client(work)


def test_the_page_itself_may_confirm_and_other_sites_may_not() -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        own = f'http://{client.host}:{client.port}'
        body = json.dumps({'sequence': 2})
        for headers, status in (
            ({**JSON_TYPE, 'Origin': own}, 200),
            ({**JSON_TYPE, 'Origin': 'http://elsewhere.example'}, 403),
            ({**JSON_TYPE, 'Origin': 'null'}, 403),
            ({'Content-Type': 'text/plain'}, 403),
        ):
            response = await client.post('/confirm', data=body, headers=headers)
            assert response.status == status, headers
        assert len(scene.confirmed) == 1

    with_client(work)


@pytest.mark.parametrize(
    ('body', 'words'),
    [(b'{', 'not JSON'), (b'[]', 'JSON object'), (b'{"sequence": 7}', 'setpoint 7')],
)
def test_a_wrong_confirmation_is_answered_with_one_line(body, words) -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        response = await client.post('/confirm', data=body, headers=JSON_TYPE)
        assert response.status == 400
        assert words in (await response.json())['error']
        assert scene.confirmed == []

    with_client(work)


@pytest.mark.parametrize(
    ('refusal', 'status'),
    [(InputError('setpoint 2 is not known'), 400), (ConfirmationUnavailable('nobody there'), 503)],
)
def test_a_refusal_of_the_graph_reaches_the_browser(refusal, status) -> None:
    async def work(scene: Scene, client: TestClient) -> None:
        scene.refusal = refusal
        response = await client.post('/confirm', json={'sequence': 2})
        assert response.status == status
        assert (await response.json())['error'] == str(refusal)

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
