"""The server of the page: its files, the maps, a stream of events, and the confirmation.

Reading is free for everyone who reaches the page under one of its names; a confirmation needs the
token (see `access`).

The stream of every browser takes the newest snapshot when it is ready for one. A slow browser
skips snapshots and delays nobody; there is no queue.
"""

import asyncio
import contextlib
import json
import logging
import socket
import threading
import time
import uuid
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError
from aiohttp.log import server_logger
from aiohttp.web_protocol import RequestHandler

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import HEARTBEAT_S, POLL_S
from porotwin_core.rates.wells import WellRates
from porotwin_core.ros.foreign_words import FewWords, in_short
from porotwin_page import confirmation
from porotwin_page.access import Access, AccessRefused
from porotwin_page.address import DEFAULT_HOST
from porotwin_page.confirmation import Confirmation, ConfirmationDoubt
from porotwin_page.curve_history import history_view
from porotwin_page.event import event_view, past_view
from porotwin_page.expectation import Expectation, expectation_view
from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.json_values import Json
from porotwin_page.map_pictures import Theme
from porotwin_page.mend_answer import MendAnswer, parse_mend_answer
from porotwin_page.panel import MapPanel, Moment
from porotwin_page.panel_registry import all_panels
from porotwin_page.past_states import PastStates
from porotwin_page.proposal import parse_proposal
from porotwin_page.report_file import read_report
from porotwin_page.rigs import NO_RIGS, RigList
from porotwin_page.snapshot_store import SnapshotStore
from porotwin_page.web_files import document, web_files
from porotwin_page.workers import Workers

SECURITY_HEADERS = {
    'Content-Security-Policy': (
        "default-src 'none'; img-src 'self' data:; connect-src 'self'; style-src 'self'; "
        "script-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Cache-Control': 'no-store',
}

REPORT_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox"
"""Content security policy of a report, which holds its pictures and its style."""

MAX_CONFIRMATION = 16 * 1024
"""Largest request of a browser [bytes]: rates of some hundred wells."""

PATIENCE_S = 10.0
"""Longest time for a request, for the body of a confirmation, and between two requests [s]."""

NO_HTTP = FewWords(logging.getLogger(__name__).warning)
"""Tells of bytes that are no request: anybody can send them."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

ConfirmFn = Callable[[Confirmation], str]
"""Passes a confirmation on; blocks and returns one line.

Raises InputError if it is refused, ConfirmationUnavailable if no node receives it.
"""

AskFn = Callable[[WellRates], Expectation]
"""Asks for the outlook of proposed rates [m^3/s] of control wells; blocks.

Raises InputError if the question is refused, SiblingsUnavailable if no node answers.
"""

MendFn = Callable[[MendAnswer], None]
"""Passes the answer to an offer on; blocks.

Raises InputError if it is refused, ConfirmationUnavailable if no node receives it.
"""

ClockFn = Callable[[], float | None]
"""Returns the time on the graph's clock [s]; None if it has not started."""


class ConfirmationUnavailable(Exception):  # noqa: N818  it is a state of the graph, not a mistake
    """Nobody receives confirmations; the message names the remedy."""


class SiblingsUnavailable(Exception):  # noqa: N818  it is a state of the graph, not a mistake
    """Nobody answers questions about rates; the message names the remedy."""


def nobody_to_ask(_: WellRates) -> Expectation:
    """Answer no question."""
    raise SiblingsUnavailable(
        'no forecast: the node siblings, an ensemble of twins, does not run; start it'
    )


def nobody_to_mend(_: MendAnswer) -> None:
    """Receive no answer."""
    raise ConfirmationUnavailable('no answer possible: the node mend does not run')


@dataclass(frozen=True)
class StreamSettings:
    """Timing and number of the streams of events.

    Attributes:
        check_period: how often a stream looks for a new snapshot [s].
        heartbeat: longest time between two events [s]; drives the countdown on the page, and its
            detection of a lost connection.
        send_timeout: a browser that accepts nothing for this time is disconnected [s]; it connects
            again by itself.
        limit: browsers that are served at the same time.
    """

    check_period: float = POLL_S
    heartbeat: float = HEARTBEAT_S
    send_timeout: float = 20.0
    limit: int = 64


class PageApplication:
    """The handlers of all requests.

    Args:
        store: holds the newest snapshot.
        confirm: passes confirmations on.
        clock: returns the time on the graph's clock [s].
        access: the rules for requests.
        ask: asks for the forecast with proposed rates; unavailable by default.
        mend: passes answers to offers on; unavailable by default.
        past: holds earlier states; an empty one by default.
        rigs: the rigs to choose from.
        settings: timing of the streams.

    Attributes:
        streams: number of browsers that are served now.
        workers: the threads that do the work of requests.
    """

    def __init__(
        self,
        store: SnapshotStore,
        confirm: ConfirmFn,
        clock: ClockFn,
        access: Access,
        *,
        ask: AskFn = nobody_to_ask,
        mend: MendFn = nobody_to_mend,
        past: PastStates | None = None,
        rigs: RigList = NO_RIGS,
        settings: StreamSettings | None = None,
    ) -> None:
        self._rigs = rigs
        self.streams = 0
        self.workers = Workers()
        self._store = store
        self._confirm = confirm
        self._ask = ask
        self._mend = mend
        self._asking = asyncio.Lock()
        self._clock = clock
        self._access = access
        self._past = PastStates(most=0) if past is None else past
        self._panels = all_panels()
        self._settings = settings or StreamSettings()
        self._run = uuid.uuid4().hex[:8]

    def make(self) -> web.Application:
        """Return the aiohttp application."""
        application = web.Application(
            client_max_size=MAX_CONFIRMATION, middlewares=[self._check_host]
        )
        application.on_response_prepare.append(self._add_headers)
        application.add_routes(
            [
                web.get('/', self.page),
                web.get('/{path:(?:web|panels)/[^/]+}', self.file),
                web.get('/events', self.events),
                web.get('/past', self.past),
                web.get('/rigs', self.rigs),
                web.get('/report', self.report),
                web.get('/map/{panel}.png', self.map),
                web.get('/values/{panel}', self.values),
                web.get('/scale/{panel}.png', self.scale),
                web.post('/confirm', self.confirm),
                web.post('/what-if', self.what_if),
                web.post('/mend', self.mend),
            ]
        )
        return application

    @web.middleware
    async def _check_host(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse a request under a foreign name: a site whose name was rebound to this machine."""
        transport = request.transport
        reached = transport.get_extra_info('sockname') if transport is not None else None
        try:
            self._access.check_host(
                request.headers.getall('Host', []), str(reached[0]) if reached else ''
            )
        except AccessRefused as refused:
            return web.json_response({'error': str(refused)}, status=403)
        return await handler(request)

    async def _add_headers(self, _: web.Request, response: web.StreamResponse) -> None:
        for name, value in SECURITY_HEADERS.items():
            response.headers.setdefault(name, value)

    async def page(self, _: web.Request) -> web.Response:
        """Answer with the HTML document."""
        return web.Response(text=document(self._panels), content_type='text/html')

    async def file(self, request: web.Request) -> web.Response:
        """Answer with a script or the style sheet; 404 for any other path."""
        found = web_files().get(request.match_info['path'])
        if found is None:
            raise web.HTTPNotFound(text=f'{request.path}: no such file\n')
        text, content_type = found
        return web.Response(text=text, content_type=content_type)

    async def rigs(self, request: web.Request) -> web.Response:
        """Answer with the rigs to choose from: name, address, and which is this one."""
        host = request.url.host or DEFAULT_HOST
        return web.json_response(await self.workers.run(self._rigs.offered, host))

    async def report(self, _: web.Request) -> web.Response:
        """Answer with the report on the newest offer; 404 if it is not on this machine."""
        offer = self._store.snapshot.offer
        if offer is None or not offer.report:
            raise web.HTTPNotFound(text='there is no report on an offer yet\n')
        path = Path(offer.report)
        try:
            text = await self.workers.run(read_report, path)
        except (OSError, ValueError):
            where = 'open it on the machine of the node diagnosis'
            raise web.HTTPNotFound(text=f'{path}: no report can be read here; {where}\n') from None
        headers = {'Content-Security-Policy': REPORT_POLICY}
        return web.Response(text=text, content_type='text/html', headers=headers)

    async def past(self, request: web.Request) -> web.Response:
        """Answer with the maps' contents of an earlier state."""
        return web.json_response(past_view(self._snapshot_for(request), self._panels))

    async def map(self, request: web.Request) -> web.Response:
        """Answer with the map of a panel as PNG; 404 if there is none yet."""
        panel, theme = self._map_panel(request), _theme(request)
        data = await self.workers.run(panel.picture, self._snapshot_for(request), theme)
        if data is None:
            raise self._no_map(request)
        return web.Response(body=data, content_type='image/png')

    async def values(self, request: web.Request) -> web.Response:
        """Answer with the values of a map: float32, little-endian, rows from the lowest upward.

        The header X-Shape holds the numbers of rows and columns.
        """
        shown = self._map_panel(request).shown(self._snapshot_for(request))
        if shown is None:
            raise self._no_map(request)
        rows, columns = shown.values.shape
        return web.Response(
            body=np.ascontiguousarray(shown.values, dtype='<f4').tobytes(),
            content_type='application/octet-stream',
            headers={'X-Shape': f'{rows} {columns}'},
        )

    def _no_map(self, request: web.Request) -> web.HTTPNotFound:
        return web.HTTPNotFound(text=f'there is no {request.match_info["panel"]} map yet\n')

    def _snapshot_for(self, request: web.Request) -> GraphSnapshot:
        """Return the snapshot of the state that the query names; the newest without a query."""
        given = request.query.get('state')
        if given is None:
            return self._store.snapshot
        number = int(given) if given.isascii() and given.isdecimal() and len(given) < 16 else -1
        found = self._past.snapshot(number, self._store.snapshot)
        if found is None:
            raise web.HTTPNotFound(text='this state is no longer kept\n')
        return found

    async def scale(self, request: web.Request) -> web.Response:
        """Answer with the colour scale of a panel as PNG, from its lowest value on."""
        panel, theme = self._map_panel(request), _theme(request)
        return web.Response(body=panel.scale(theme), content_type='image/png')

    def _map_panel(self, request: web.Request) -> MapPanel:
        maps = {name: p for name, p in self._panels.items() if isinstance(p, MapPanel)}
        return _choice(request, request.match_info['panel'], maps)

    async def events(self, request: web.Request) -> web.StreamResponse:
        """Stream events (server-sent events) until the browser disconnects."""
        limit = self._settings.limit
        if self.streams >= limit:
            raise web.HTTPServiceUnavailable(text=f'{limit} browsers are served already\n')
        response = web.StreamResponse(headers={'Content-Type': 'text/event-stream'})
        self.streams += 1
        try:
            await response.prepare(request)
            await self._stream(response)
        except (ConnectionError, TimeoutError):
            if request.transport is not None:
                request.transport.abort()
        finally:
            self.streams -= 1
        return response

    async def _stream(self, response: web.StreamResponse) -> None:
        settings = self._settings
        sent_revision, sent_at, points_sent = -1, -settings.heartbeat, -1
        contents: dict[str, Any] = {}
        while True:
            revision = self._store.revision
            now = time.monotonic()
            if revision != sent_revision or now - sent_at >= settings.heartbeat:
                text, points_sent, contents = self._event(now, points_sent, contents)
                async with asyncio.timeout(settings.send_timeout):
                    await response.write(f'data: {text}\n\n'.encode())
                sent_revision, sent_at = revision, now
            await asyncio.sleep(settings.check_period)

    def _event(
        self, steady: float, points_sent: int, sent: dict[str, Any]
    ) -> tuple[str, int, dict[str, Any]]:
        """Return the newest event as JSON, the number of points sent, and all panels' contents.

        The event has only those panels whose contents differ from the `sent` ones.
        """
        snapshot = self._store.snapshot
        history = history_view(snapshot, self._panels, after=points_sent)
        event = event_view(snapshot, Moment(self._clock(), steady), self._panels)
        contents = event['panels']
        event |= {
            'run': self._run,
            'history': history,
            'states': {'first': self._past.first, 'last': self._past.last},
            'panels': {
                name: content
                for name, content in contents.items()
                if name not in sent or sent[name] != content
            },
        }
        text = json.dumps(event, allow_nan=False, separators=(',', ':'))
        return text, history['end'], contents

    async def confirm(self, request: web.Request) -> web.Response:
        """Pass a confirmation on and answer with one line."""
        status, answer = await self._confirmation(request)
        return web.json_response(answer, status=status)

    async def _confirmation(self, request: web.Request) -> tuple[int, dict[str, str]]:
        if request.content_type != 'application/json':
            return 415, {'error': 'confirmation: send application/json'}
        token = request.headers.get('Authorization', '').removeprefix('Bearer').strip()
        try:
            self._access.check_change(request.headers.get('Origin'), request.host, token)
            async with asyncio.timeout(PATIENCE_S):
                body = await request.read()
            given = confirmation.parse(confirmation.decoded(body), self._store.snapshot)
            return 200, {'message': await self.workers.run(self._confirm, given)}
        except AccessRefused as refused:
            return 403, {'error': str(refused)}
        except web.HTTPRequestEntityTooLarge:
            return 413, {'error': f'confirmation: longer than {MAX_CONFIRMATION} bytes'}
        except TimeoutError:
            return 408, {'error': f'confirmation: not complete within {PATIENCE_S:g} s'}
        except InputError as error:
            return 400, {'error': str(error)}
        except ConfirmationDoubt as doubt:
            return 409, {'question': str(doubt)}
        except ConfirmationUnavailable as error:
            return 503, {'error': str(error)}

    async def what_if(self, request: web.Request) -> web.Response:
        """Answer with the forecast for proposed rates; nothing is pumped.

        Only one forecast runs at a time, because it takes computing time from the twin.
        """

        async def outlook(data: Any) -> tuple[int, Json]:
            rates = parse_proposal(data, self._store.snapshot)
            if self._asking.locked():
                return 429, {'error': 'another question is being answered; ask again'}
            async with self._asking:
                return 200, expectation_view(await self.workers.run(self._ask, rates))

        return await self._with_token(request, 'proposal', outlook)

    async def mend(self, request: web.Request) -> web.Response:
        """Pass the answer to an offer on."""

        async def answered(data: Any) -> tuple[int, Json]:
            await self.workers.run(self._mend, parse_mend_answer(data))
            return 200, {}

        return await self._with_token(request, 'answer', answered)

    async def _with_token(
        self, request: web.Request, what: str, act: Callable[[Any], Awaitable[tuple[int, Json]]]
    ) -> web.Response:
        """Answer with the result of `act` on the body of a request that has the token."""
        if request.content_type != 'application/json':
            return _error(415, f'{what}: send application/json')
        token = request.headers.get('Authorization', '').removeprefix('Bearer').strip()
        try:
            self._access.check_change(request.headers.get('Origin'), request.host, token)
            async with asyncio.timeout(PATIENCE_S):
                body = await request.read()
            status, answer = await act(confirmation.decoded(body))
        except AccessRefused as refused:
            return _error(403, str(refused))
        except web.HTTPRequestEntityTooLarge:
            return _error(413, f'{what}: longer than {MAX_CONFIRMATION} bytes')
        except TimeoutError:
            return _error(408, f'{what}: the request did not arrive as a whole')
        except InputError as error:
            return _error(400, str(error))
        except (SiblingsUnavailable, ConfirmationUnavailable) as error:
            return _error(503, str(error))
        return web.json_response(answer, status=status)


def _error(status: int, text: str) -> web.Response:
    return web.json_response({'error': text}, status=status)


def _theme(request: web.Request) -> Theme:
    themes: dict[str, Theme] = {theme: theme for theme in get_args(Theme)}
    return _choice(request, request.query.get('theme', 'light'), themes)


def _choice(request: web.Request, given: str, choices: Mapping[str, Any]) -> Any:
    if given not in choices:
        raise web.HTTPNotFound(text=f'{request.path}: choose one of {", ".join(choices)}\n')
    return choices[given]


def _tell_briefly(record: logging.LogRecord) -> bool:
    """Return whether the library logs a record with its traceback: not if it is no request."""
    fault = record.exc_info[1] if record.exc_info else None
    if not isinstance(fault, HttpProcessingError):
        return True
    NO_HTTP.tell('', f'a request was refused, for it is no HTTP: {in_short(fault.message)}')
    return False


class ServerThread:
    """Serves an application on a listening socket, in a thread with an event loop of its own."""

    def __init__(self, application: web.Application, listening: socket.socket) -> None:
        self._loop = asyncio.new_event_loop()
        self._serving = self._loop.create_task(self._serve(application, listening))
        self._thread = threading.Thread(target=self._run, name='page', daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            # the end of the runner cancels all open streams
            runner.run(self._until_cancelled())

    async def _until_cancelled(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            await self._serving

    async def _serve(self, application: web.Application, listening: socket.socket) -> None:
        silent: dict[object, asyncio.TimerHandle] = {}

        @web.middleware
        async def first(request: web.Request, handler: Handler) -> web.StreamResponse:
            if timer := silent.pop(request.protocol, None):
                timer.cancel()
            if 'Content-Encoding' in request.headers:
                return _error(415, 'send the request without compression')
            return await handler(request)

        application.middlewares.insert(0, first)
        server_logger.addFilter(_tell_briefly)
        runner = web.AppRunner(
            application,
            access_log=None,
            shutdown_timeout=0.1,
            auto_decompress=False,
            keepalive_timeout=PATIENCE_S,
        )
        await runner.setup()
        server = runner.server
        assert server is not None

        def connected() -> asyncio.Protocol:
            connection = server()
            silent[connection] = self._loop.call_later(PATIENCE_S, end, connection)
            return connection

        def end(connection: RequestHandler) -> None:
            del silent[connection]
            connection.force_close()

        serving = await self._loop.create_server(connected, sock=listening)
        try:
            await asyncio.Event().wait()
        finally:
            serving.close()
            await runner.cleanup()

    def close(self) -> None:
        """Stop serving, including all streams, and wait for the thread."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._serving.cancel)
            self._thread.join(5.0)
