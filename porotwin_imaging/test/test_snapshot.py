"""Snapshots of a network camera, from a server on this computer."""

import base64
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.sources.snapshot import PASSWORD, SnapshotSource, check_url
from porotwin_imaging.sources.source_registry import source_at

Answer = Callable[[BaseHTTPRequestHandler], None]


class FakeCamera:
    """A server; `answer` is called with each request."""

    def __init__(self, server: ThreadingHTTPServer) -> None:
        self.host = f'127.0.0.1:{server.server_port}'
        self.url = f'http://{self.host}/snap.jpg?pwd=hidden'
        self.answer: Answer = lambda request: reply(request, 404)


def reply(request: BaseHTTPRequestHandler, code: int, data: bytes = b'', **headers: str) -> None:
    request.send_response(code)
    for name, value in headers.items():
        request.send_header(name.replace('_', '-'), value)
    request.end_headers()
    request.wfile.write(data)


@pytest.fixture
def camera() -> Iterator[FakeCamera]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            found.answer(self)

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(('127.0.0.1', 0), Handler) as server:
        server.daemon_threads = True
        found = FakeCamera(server)
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield found
        server.shutdown()


def test_each_poll_fetches_a_photograph(camera, empty_photograph) -> None:
    camera.answer = lambda request: reply(request, 200, empty_photograph)
    kind, address = source_at(camera.url)
    assert kind.name == 'snapshot'
    source = kind.open(address, clock=lambda: 12.0)
    for _ in range(2):
        (photo,) = source.poll().photos
        assert (photo.data, photo.time, photo.role) == (empty_photograph, 12.0, None)


def test_a_camera_that_asks_for_a_password_gets_it_and_no_line_shows_it(
    camera, empty_photograph, monkeypatch
) -> None:
    wanted = 'Basic ' + base64.b64encode(b'me:top secret').decode()

    def answer(request: BaseHTTPRequestHandler) -> None:
        if request.headers.get('Authorization') == wanted:
            reply(request, 200, empty_photograph)
        else:
            reply(request, 401, WWW_Authenticate='Basic realm="camera"')

    camera.answer = answer
    host = camera.host
    assert SnapshotSource(f'http://me:top%20secret@{host}/snap.jpg').poll().photos
    monkeypatch.setenv(PASSWORD, 'top secret')
    assert SnapshotSource(f'http://me@{host}/snap.jpg').poll().photos
    polled = SnapshotSource(f'http://me:wrong@{host}/snap.jpg?pwd=hidden').poll()
    assert polled.absent == f'camera http://{host}/snap.jpg answers 401 Unauthorized'


def test_an_unchanged_picture_is_a_problem(camera, empty_photograph) -> None:
    def answer(request: BaseHTTPRequestHandler) -> None:
        if request.headers.get('If-None-Match') == '"1"':
            reply(request, 304)
        else:
            reply(request, 200, empty_photograph, ETag='"1"')

    camera.answer = answer
    source = SnapshotSource(camera.url)
    assert source.poll().photos
    assert source.poll().problems[0].code == 'old_picture'


@pytest.mark.parametrize(
    ('data', 'code'),
    [(b'<html>', 'other_format'), (b'', 'other_format'), (b'\xff\xd8\xff\xe0 cut', 'truncated')],
)
def test_an_answer_without_a_picture_is_a_problem(camera, data: bytes, code: str) -> None:
    camera.answer = lambda request: reply(request, 200, data, Content_Type='text/html')
    (problem,) = SnapshotSource(camera.url).poll().problems
    assert problem.code == code
    assert 'hidden' not in str(problem)


def test_a_camera_that_does_not_answer_is_absent(camera, empty_photograph) -> None:
    camera.answer = lambda request: reply(request, 500)
    assert 'answers 500' in SnapshotSource(camera.url).poll().absent
    camera.answer = lambda request: request.wfile.write(b'no HTTP\r\n\r\n')
    assert 'does not answer' in SnapshotSource(camera.url).poll().absent
    camera.answer = lambda request: threading.Event().wait(60.0)
    assert 'does not answer: timed out' in SnapshotSource(camera.url, timeout_s=0.1).poll().absent
    assert 'does not answer' in SnapshotSource('http://127.0.0.1:1/x').poll().absent
    # each byte comes in time, the picture does not
    camera.answer = lambda request: reply(request, 200, empty_photograph)
    hours = iter(range(0, 10**6, 3600))
    slow = SnapshotSource(camera.url, steady=lambda: float(next(hours)))
    assert 'the picture is not complete after 10 s' in slow.poll().absent


def test_a_picture_that_trickles_in_ends_at_the_deadline(camera, empty_photograph) -> None:
    ended = threading.Event()

    def trickle(request: BaseHTTPRequestHandler) -> None:
        reply(request, 200, empty_photograph[:100], Content_Length='100000')
        while not ended.wait(0.02):
            request.wfile.write(b'x')

    camera.answer = trickle
    polled = SnapshotSource(camera.url, timeout_s=0.3).poll()
    ended.set()
    assert 'the picture is not complete after 0.3 s' in polled.absent


def test_a_video_stream_is_told_as_what_it_is(camera) -> None:
    kind = 'multipart/x-mixed-replace; boundary=frame'
    camera.answer = lambda request: reply(request, 200, b'--frame', Content_Type=kind)
    (problem,) = SnapshotSource(camera.url).poll().problems
    assert problem.code == 'video'


@pytest.mark.parametrize(
    'url',
    ['camera', 'file:///etc/passwd', 'http://', 'http://a:b@', 'http://h:99999/x', 'http://h/ö'],
)
def test_an_address_that_is_no_url_is_refused(url: str) -> None:
    with pytest.raises(InputError, match='camera URL'):
        check_url(url)


def test_a_wrong_url_does_not_show_a_password() -> None:
    with pytest.raises(InputError) as found:
        check_url('http://me:secret@host:port/x?pwd=hidden')
    assert 'secret' not in str(found.value)
    assert 'hidden' not in str(found.value)


def test_a_picture_that_arrived_truncated_is_fetched_again(camera, empty_photograph) -> None:
    pictures = [empty_photograph[:-1000], empty_photograph]

    def answer(request: BaseHTTPRequestHandler) -> None:
        if request.headers.get('If-None-Match') == '"one"':
            reply(request, 304)
        else:
            reply(request, 200, pictures.pop(0), ETag='"one"')

    camera.answer = answer
    source = SnapshotSource(camera.url)
    (problem,) = source.poll().problems
    assert problem.code == 'truncated'
    assert len(source.poll().photos) == 1
    (problem,) = source.poll().problems
    assert problem.code == 'old_picture'
