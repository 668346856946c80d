"""Tests of the page in a browser: the drawing, the button, and a lost connection."""

import asyncio
import contextlib
import shutil
import subprocess
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from typing import Any

import pytest
from aiohttp import ClientSession, ClientWebSocketResponse
from page_examples import START, TOKEN, observed_state, rates, setpoint, two_cycles

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.access import Access
from porotwin_page.address import listen
from porotwin_page.confirmation import Confirmation
from porotwin_page.past_states import PastStates
from porotwin_page.server import PageApplication, ServerThread
from porotwin_page.snapshot_store import SnapshotStore

NAMES = ('chromium', 'chromium-browser', 'google-chrome')
BROWSER = next((found for name in NAMES if (found := shutil.which(name))), None)
TIMEOUT_S = 40.0
OPTIONS = [
    '--headless',
    '--no-sandbox',
    '--disable-gpu',
    '--disable-background-networking',
    '--no-first-run',
    '--disable-component-update',
    '--disable-sync',
    '--disable-dev-shm-usage',
    '--remote-debugging-port=0',
]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.graph,  # a real browser: among the tests of real processes
    pytest.mark.skipif(BROWSER is None, reason=f'needs one of {", ".join(NAMES)}'),
]


class Tab:
    """A tab of the browser, controlled by the DevTools protocol."""

    def __init__(self, socket: ClientWebSocketResponse) -> None:
        self._socket = socket
        self._calls = 0
        self.faults: list[str] = []

    async def call(self, method: str, **parameters: Any) -> dict:
        self._calls += 1
        message = {'id': self._calls, 'method': method, 'params': parameters}
        await self._socket.send_json(message)
        while True:
            answer = await self._socket.receive_json()
            self._collect_fault(answer)
            if answer.get('id') == message['id']:
                return answer.get('result', {})

    def _collect_fault(self, answer: dict) -> None:
        """Keep exceptions and errors in the console, except those of a lost connection."""
        parameters = answer.get('params', {})
        if answer.get('method') == 'Runtime.exceptionThrown':
            self.faults.append(str(parameters))
        if answer.get('method') == 'Log.entryAdded':
            entry = parameters['entry']
            # a lost stream, a question of the server, which is status 409, and a closed server
            lost = 'ERR_CONNECTION_REFUSED' in entry.get('text', '')
            expected = lost or entry.get('url', '').endswith(('/events', '/confirm'))
            if entry['level'] == 'error' and not expected:
                self.faults.append(str(entry))

    async def value(self, script: str) -> Any:
        result = await self.call('Runtime.evaluate', expression=script, returnByValue=True)
        return result['result'].get('value')

    async def until(self, script: str) -> None:
        """Return when `script` is true in the page."""
        for _ in range(int(TIMEOUT_S / 0.1)):
            if await self.value(script):
                return
            await asyncio.sleep(0.1)
        text = await self.value('document.body.innerText')
        raise AssertionError(f'{script}: not within {TIMEOUT_S:g} s; the page shows {text}')

    async def resize(self, width: int, height: int) -> None:
        await self.call(
            'Emulation.setDeviceMetricsOverride',
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )


@pytest.fixture(scope='module')
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The DevTools address of a browser, in which each test has a tab of its own."""
    assert BROWSER is not None
    folder = tmp_path_factory.mktemp('browser')
    command = [BROWSER, *OPTIONS, f'--user-data-dir={folder}', 'about:blank']
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        written, port = folder / 'DevToolsActivePort', ''
        for _ in range(int(TIMEOUT_S / 0.1)):
            if written.is_file() and (port := written.read_text().partition('\n')[0]):
                break
            time.sleep(0.1)
        yield f'http://127.0.0.1:{port}/json'
    finally:
        process.terminate()
        process.wait(20)


@contextlib.asynccontextmanager
async def new_tab(browser: str) -> AsyncIterator[Tab]:
    async with ClientSession() as session:
        async with session.put(f'{browser}/new?about:blank') as response:
            target = await response.json()
        async with session.ws_connect(target['webSocketDebuggerUrl'], max_msg_size=0) as socket:
            tab = Tab(socket)
            await tab.call('Runtime.enable')
            await tab.call('Log.enable')
            yield tab
        async with session.get(f'{browser}/close/{target["id"]}') as response:
            assert response.ok


class Scene:
    """A page that is served as the node does it."""

    def __init__(self) -> None:
        self.store = SnapshotStore()
        self.store.update(lambda _: two_cycles())
        self.store.update(snapshot.with_measured, rates(100.0), by_person=True)
        self.confirmed: list[Confirmation] = []
        self.clock = START + 40.0
        self.past = PastStates()
        self.past.add(self.store.snapshot)
        with listen('127.0.0.1:0') as free:
            self.port = free.getsockname()[1]
        self.serve()

    @property
    def address(self) -> str:
        return f'http://127.0.0.1:{self.port}'

    def serve(self) -> None:
        application = PageApplication(
            self.store, self.confirm, lambda: self.clock, Access(TOKEN), past=self.past
        )
        self.server = ServerThread(application.make(), listen(f'127.0.0.1:{self.port}'))

    def confirm(self, given: Confirmation) -> str:
        self.confirmed.append(given)
        self.store.update(snapshot.with_confirmation, given.sequence, safe=given.safe)
        return f'setpoint {given.sequence} confirmed'


Work = Callable[[Scene, Tab], Awaitable[None]]


@pytest.fixture
def in_browser(browser: str) -> Callable[[Work], None]:
    """A function that shows a scene in a new tab and works there."""

    async def go(work: Work) -> None:
        scene = Scene()
        try:
            async with new_tab(browser) as tab:
                await tab.call('Page.navigate', url=f'{scene.address}/#token={TOKEN}')
                await tab.until("document.querySelector('#live')?.textContent.startsWith('Stale')")
                await work(scene, tab)
                assert tab.faults == []
        finally:
            scene.server.close()
            scene.past.close()

    return lambda work: asyncio.run(go(work))


@pytest.mark.parametrize('size', [(1400, 1000), (390, 844)])
@pytest.mark.parametrize('theme', ['light', 'dark'])
def test_all_panels_are_drawn_and_fit_the_width(in_browser, size, theme) -> None:
    async def work(_: Scene, tab: Tab) -> None:
        scheme = {'name': 'prefers-color-scheme', 'value': theme}
        await tab.call('Emulation.setEmulatedMedia', features=[scheme])
        await tab.resize(*size)
        await tab.until(f"document.documentElement.dataset.theme === '{theme}'")
        await tab.until("document.querySelectorAll('.map img').length === 3")
        await tab.until("[...document.querySelectorAll('.map img')].every((i) => i.naturalWidth)")
        shown = await tab.value("document.querySelector('#rates').innerText")
        assert '120.0' in shown
        assert '−620.0' in shown
        changed = await tab.value("document.querySelectorAll('#rates .changed').length")
        assert changed == 2  # control1 and the producer that balances it
        assert await tab.value("document.querySelector('#validity-text').textContent") == (
            'valid for 1:20 min'
        )
        assert await tab.value("document.querySelectorAll('#observed circle.well').length") == 5
        assert await tab.value("document.querySelectorAll('.zone').length") == 3
        assert await tab.value("document.querySelectorAll('.panel-chart path').length") == 9
        width = await tab.value('document.documentElement.scrollWidth')
        assert width <= size[0]

    in_browser(work)


def test_the_button_confirms_with_other_rates(in_browser) -> None:
    async def work(scene: Scene, tab: Tab) -> None:
        await tab.until("!document.querySelector('#done').disabled")
        await tab.value(
            "document.querySelector('#other-rates input[name=control1]').value = '68.5';"
            "document.querySelector('#done').focus()"
        )
        enter = {'key': 'Enter', 'code': 'Enter', 'windowsVirtualKeyCode': 13, 'text': '\r'}
        await tab.call('Input.dispatchKeyEvent', type='keyDown', **enter)
        await tab.until("document.querySelector('#question-text').textContent.includes('balance')")
        assert scene.confirmed == []
        await tab.value("document.querySelector('#question-yes').click()")
        await tab.until("document.querySelector('#answer').textContent === 'setpoint 2 confirmed'")
        (given,) = scene.confirmed
        assert given.sequence == 2
        assert given.rates == {**rates(120.0), 'control1': rates(68.5)['control1']}
        await tab.until("document.querySelector('#done').textContent.includes('Confirmed')")

    in_browser(work)


def test_a_new_setpoint_replaces_the_old_one(in_browser) -> None:
    async def work(scene: Scene, tab: Tab) -> None:
        scene.store.update(snapshot.with_setpoint, setpoint(3, 77.0))
        await tab.until("document.querySelector('#rates').innerText.includes('77.0')")
        await tab.until("document.querySelector('#done').textContent.startsWith('Done')")

    in_browser(work)


def test_the_safe_rates_are_confirmed_with_a_button_of_their_own(in_browser) -> None:
    async def work(scene: Scene, tab: Tab) -> None:
        scene.clock = START + 200.0
        scene.store.update(snapshot.with_measured, rates(120.0), by_person=True)
        await tab.until("document.querySelector('#done').textContent.startsWith('I have set')")
        shown = await tab.value("document.querySelector('#rates').innerText")
        assert '−500.0' in shown
        assert '120.0' in shown
        await tab.until("!document.querySelector('#done').disabled")
        await tab.value("document.querySelector('#done').click()")
        await tab.until("document.querySelector('#answer').textContent === 'setpoint 2 confirmed'")
        (given,) = scene.confirmed
        assert given.safe
        assert given.rates == rates(0.0)

    in_browser(work)


def test_without_the_token_the_page_is_read_only_until_it_is_typed(in_browser) -> None:
    async def work(scene: Scene, tab: Tab) -> None:
        await tab.value('sessionStorage.clear()')
        await tab.call('Page.navigate', url=f'{scene.address}/')
        await tab.until("document.querySelector('#token')?.hidden === false")
        assert await tab.value("document.querySelector('#done').disabled")
        await tab.value(
            f"document.querySelector('#token-text').value = '{TOKEN}';"
            "document.querySelector('#token button').click()"
        )
        await tab.until("document.querySelector('#token').hidden")
        await tab.until("!document.querySelector('#done').disabled")

    in_browser(work)


def test_the_slider_shows_an_earlier_state_and_returns(in_browser) -> None:
    async def work(scene: Scene, tab: Tab) -> None:
        scene.store.update(snapshot.with_observed_state, observed_state(3, value=0.7))
        scene.past.add(scene.store.snapshot)
        await tab.until("document.querySelector('#time-slider').max === '2'")
        await tab.value(
            "const s = document.querySelector('#time-slider'); s.value = 1;"
            "s.dispatchEvent(new Event('input'))"
        )
        await tab.until("document.querySelector('#time-text').textContent.includes('photograph 2')")
        await tab.until("document.querySelector('#observed .map img').src.includes('state=1')")
        assert await tab.value("document.body.classList.contains('past')")
        await tab.value(
            "const box = document.querySelector('#observed .map').getBoundingClientRect();"
            "document.querySelector('#observed .map').dispatchEvent(new PointerEvent('pointermove',"
            '{clientX: box.left + 9, clientY: box.bottom - 9}))'
        )
        await tab.until(
            "document.querySelector('#observed .reading').textContent.includes('0.450')"
        )
        await tab.value("document.querySelector('#time-now').click()")
        await tab.until("!document.querySelector('#observed .map img').src.includes('state=')")

    in_browser(work)


def test_a_lost_connection_is_reported_and_made_again(in_browser) -> None:
    async def work(scene: Scene, tab: Tab) -> None:
        scene.server.close()
        await tab.until("document.querySelector('#live').textContent.startsWith('Not connected')")
        assert await tab.value("document.querySelector('#done').disabled")
        scene.serve()
        await tab.until("document.querySelector('#live').textContent.startsWith('Stale')")
        await tab.until("document.querySelector('.panel-chart svg').dataset.points === '2'")
        # pictures that the closed server could not send as well
        await tab.until("[...document.querySelectorAll('.map img')].every((i) => i.naturalWidth)")

    in_browser(work)
