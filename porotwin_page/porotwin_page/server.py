"""The page's server: one document, its maps, a stream of events, and the confirmation.

Each browser's stream reads the newest snapshot when it is ready for one, so a slow browser skips
moments and holds up nobody. Nothing is queued.
"""

import asyncio
import contextlib
import json
import socket
import threading
import time
import uuid
from collections.abc import Callable
from typing import Any, get_args

from aiohttp import web

from porotwin_core.errors import InputError
from porotwin_page import confirmation
from porotwin_page.board import Board
from porotwin_page.confirmation import Confirmation
from porotwin_page.document import document
from porotwin_page.pictures import Kind, Theme, picture, scale
from porotwin_page.view import history_view, state_view

LOOK_PERIOD = 0.2
"""How often a stream looks for news [s]."""

HEARTBEAT = 1.0
"""The longest time between two events [s]; the countdown and the browser's watchdog live on it."""

SEND_TIMEOUT = 20.0
"""A browser that takes nothing for so long [s] is let go; it comes back by itself."""

MOST_STREAMS = 64
"""Browsers served at once."""

SECURITY_HEADERS = {
    'Content-Security-Policy': (
        "default-src 'none'; img-src 'self' data:; connect-src 'self'; "
        "style-src 'unsafe-inline'; script-src 'unsafe-inline'; frame-ancestors 'none'"
    ),
    'X-Content-Type-Options': 'nosniff',
    'Cache-Control': 'no-store',
}

ConfirmFn = Callable[[Confirmation], str]
"""Passes a confirmation on, blocking; returns one line.

Raises InputError when it is refused, ConfirmationUnavailable when nobody takes it.
"""

ClockFn = Callable[[], float | None]
"""Time on the graph's clock [s]; None while there is none."""


class ConfirmationUnavailable(Exception):  # noqa: N818  it is a state of the graph, not a mistake
    """Nobody takes confirmations; the message says what would mend it."""


def _choice(request: web.Request, given: str, kind: Any) -> Any:
    if given not in get_args(kind):
        raise web.HTTPNotFound(text=f'{request.path}: choose one of {", ".join(get_args(kind))}\n')
    return given


class PageApplication:
    """The handlers, and what they share."""

    def __init__(self, board: Board, confirm: ConfirmFn, clock: ClockFn) -> None:
        self._board = board
        self._confirm = confirm
        self._clock = clock
        self._run = uuid.uuid4().hex[:8]
        self.streams = 0

    def make(self) -> web.Application:
        """Return the aiohttp application."""
        application = web.Application(client_max_size=64 * 1024)
        application.on_response_prepare.append(self._add_headers)
        application.add_routes(
            [
                web.get('/', self.page),
                web.get('/events', self.events),
                web.get('/map/{kind}.png', self.map),
                web.get('/scale/{kind}.png', self.scale),
                web.post('/confirm', self.confirm),
            ]
        )
        return application

    async def _add_headers(self, _: web.Request, response: web.StreamResponse) -> None:
        for name, value in SECURITY_HEADERS.items():
            response.headers.setdefault(name, value)

    async def page(self, _: web.Request) -> web.Response:
        """Answer with the document."""
        return web.Response(text=document(), content_type='text/html')

    async def map(self, request: web.Request) -> web.Response:
        """Answer with a map as PNG; 404 while there is none."""
        kind: Kind = _choice(request, request.match_info['kind'], Kind)
        theme: Theme = _choice(request, request.query.get('theme', 'light'), Theme)
        data = await asyncio.to_thread(picture, self._board.snapshot, kind, theme)
        if data is None:
            raise web.HTTPNotFound(text=f'there is no {kind} map yet\n')
        return web.Response(body=data, content_type='image/png')

    async def scale(self, request: web.Request) -> web.Response:
        """Answer with the colours of a map's scale, least to most."""
        kind: Kind = _choice(request, request.match_info['kind'], Kind)
        theme: Theme = _choice(request, request.query.get('theme', 'light'), Theme)
        return web.Response(body=scale(kind, theme), content_type='image/png')

    async def events(self, request: web.Request) -> web.StreamResponse:
        """Stream the newest state as server-sent events until the browser leaves."""
        if self.streams >= MOST_STREAMS:
            raise web.HTTPServiceUnavailable(text=f'{MOST_STREAMS} browsers are served already\n')
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
        sent_revision, sent_at, next_point = -1, -HEARTBEAT, -1
        while True:
            revision = self._board.revision
            now = time.monotonic()
            if revision != sent_revision or now - sent_at >= HEARTBEAT:
                snapshot = self._board.snapshot
                history = history_view(snapshot, after=next_point)
                event = state_view(snapshot, now=self._clock(), steady=now)
                event |= {'run': self._run, 'history': history}
                text = json.dumps(event, allow_nan=False, separators=(',', ':'))
                async with asyncio.timeout(SEND_TIMEOUT):
                    await response.write(f'data: {text}\n\n'.encode())
                sent_revision, sent_at, next_point = revision, now, history['end']
            await asyncio.sleep(LOOK_PERIOD)

    async def confirm(self, request: web.Request) -> web.Response:
        """Pass a confirmation on and answer in one line what came of it."""
        origin = request.headers.get('Origin')
        if request.content_type != 'application/json' or (
            origin is not None and origin.partition('://')[2] != request.host
        ):
            # other sites that a browser has open can only send other types or another origin
            return web.json_response({'error': 'confirm from the page itself'}, status=403)
        try:
            given = confirmation.parse(await request.json(), self._board.snapshot)
            message = await asyncio.to_thread(self._confirm, given)
        except json.JSONDecodeError:
            return web.json_response({'error': 'confirmation: not JSON'}, status=400)
        except InputError as error:
            return web.json_response({'error': str(error)}, status=400)
        except ConfirmationUnavailable as error:
            return web.json_response({'error': str(error)}, status=503)
        return web.json_response({'message': message})


class ServerThread:
    """Serves an application on a socket from a thread and event loop of its own."""

    def __init__(self, application: web.Application, listening: socket.socket) -> None:
        self._loop = asyncio.new_event_loop()
        self._serving = self._loop.create_task(self._serve(application, listening))
        self._thread = threading.Thread(target=self._run, name='page', daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            # leaving the runner ends the streams that are still open
            runner.run(self._until_told())

    async def _until_told(self) -> None:
        with contextlib.suppress(asyncio.CancelledError):
            await self._serving

    async def _serve(self, application: web.Application, listening: socket.socket) -> None:
        runner = web.AppRunner(application, access_log=None, shutdown_timeout=0.1)
        await runner.setup()
        try:
            await web.SockSite(runner, listening).start()
            await asyncio.Event().wait()
        finally:
            await runner.cleanup()

    def close(self) -> None:
        """End serving, streams included, and wait for it."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._serving.cancel)
            self._thread.join(5.0)
