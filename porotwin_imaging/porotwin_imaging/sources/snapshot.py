"""A network camera that answers each HTTP request with a photograph: one per poll.

A name and a password in the URL answer the camera's question for them, Basic or Digest. They are
never printed. A password may also stand in the environment variable `POROTWIN_CAMERA_PASSWORD`.
"""

import http.client
import io
import os
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from http import HTTPStatus
from typing import Any
from urllib.parse import unquote, urlsplit, urlunsplit

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.clock.stamps import steady_time
from porotwin_imaging.photograph.file_names import one_line, printable
from porotwin_imaging.photograph.photo_file import MOST_BYTES, is_complete, is_photograph
from porotwin_imaging.sources.camera_source import (
    CameraPhoto,
    Polled,
    SourceKind,
    SourceOption,
)

PASSWORD = 'POROTWIN_CAMERA_PASSWORD'
"""Environment variable with the password of a user who is named in the URL."""


class SnapshotSource:
    """Fetches a photograph at each poll.

    Args:
        url: address of the snapshot, http://[USER[:PASSWORD]@]HOST/PATH.
        timeout_s: longest time for an answer [s], from the request to its last byte.
        clock: returns the exposure time [s].
        steady: returns the time of a steady clock [s].

    Raises:
        InputError: the address is no URL of HTTP.
    """

    def __init__(
        self,
        url: str,
        *,
        timeout_s: float = 10.0,
        clock: Callable[[], float] = steady_time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        check_url(url)
        self._url, self._shown, user, password = _parts(url)
        passwords = urllib.request.HTTPPasswordMgrWithDefaultRealm()
        if user:
            passwords.add_password(None, self._url, user, password)
        self._opener = urllib.request.build_opener(
            urllib.request.HTTPBasicAuthHandler(passwords),
            urllib.request.HTTPDigestAuthHandler(passwords),
        )
        self._timeout_s = timeout_s
        self._clock = clock
        self._steady = steady
        self._tag = ''

    def poll(self) -> Polled:
        """Fetch a photograph; see `CameraSource.poll`."""
        moment = self._clock()
        request = urllib.request.Request(self._url, headers={'Cache-Control': 'no-cache'})
        if self._tag:
            request.add_header('If-None-Match', self._tag)
        try:
            with self._opener.open(request, timeout=self._timeout_s) as answer:
                kind = str(answer.headers.get('Content-Type', 'no type'))
                if kind.startswith('multipart/'):
                    return self._problem(
                        'video', 'answers with a video stream; give the URL of one picture'
                    )
                data = self._read(answer)
                tag = str(answer.headers.get('ETag', ''))
        except urllib.error.HTTPError as error:
            if error.code == HTTPStatus.NOT_MODIFIED:
                return self._problem('old_picture', 'has no new picture')
            return self._absent(f'answers {error.code} {error.reason}')
        except (OSError, http.client.HTTPException, ValueError) as error:
            return self._absent(f'does not answer: {getattr(error, "reason", error)}')
        if not is_photograph(data):
            words = f'answers with {kind} of {len(data)} bytes, no JPEG or PNG'
            return self._problem('other_format', words)
        if not is_complete(data):
            return self._problem(
                'truncated', f'answers with a truncated picture of {len(data)} bytes'
            )
        self._tag = tag  # of a whole picture: any other one is fetched again
        return Polled([CameraPhoto(data, moment, f'snapshot at {moment:.3f} s')], [])

    def _read(self, answer: http.client.HTTPResponse) -> bytes:
        """Return the bytes of an answer.

        Raises:
            OSError: it takes too long or is too large.
        """
        deadline = self._steady() + self._timeout_s
        parts: list[bytes] = []
        size = 0
        # what is there; read waits for a whole block
        while part := answer.read1(io.DEFAULT_BUFFER_SIZE):
            parts.append(part)
            size += len(part)
            if self._steady() > deadline:
                raise OSError(f'the picture is not complete after {self._timeout_s:g} s')
            if size > MOST_BYTES:
                raise OSError(f'more than {MOST_BYTES / 1e6:.0f} MB')
        return b''.join(parts)

    def _problem(self, code: str, text: str) -> Polled:
        why, _, remedy = text.partition('; ')
        return Polled([], [Remark(self._shown, '', f'the camera {why}', remedy, code=code)])

    def _absent(self, text: Any) -> Polled:
        return Polled([], [], absent=one_line(f'camera {self._shown} {text}'))


def _parts(url: str) -> tuple[str, str, str, str]:
    """Return the URL without a user, the URL to show, the user and the password."""
    parts = urlsplit(url)
    host = parts.netloc.rpartition('@')[2]
    plain = urlunsplit((parts.scheme, host, parts.path or '/', parts.query, ''))
    shown = printable(urlunsplit((parts.scheme, host, parts.path or '/', '', '')))
    password = os.environ.get(PASSWORD, '') if parts.password is None else unquote(parts.password)
    return plain, shown, unquote(parts.username or ''), password


def check_url(url: str) -> None:
    """Check the address of a snapshot.

    Raises:
        InputError: it is no URL of HTTP.
    """
    fault = 'it must be http://HOST/PATH or https://HOST/PATH'
    try:
        parts = urlsplit(url)
        if parts.scheme in ('http', 'https') and parts.hostname and (parts.port or 1) > 0:
            url.encode('ascii')
            if not any(letter.isspace() for letter in url):
                return
    except ValueError:
        fault = 'host, port or path is wrong; write other letters as %xx'
    shown = printable(url.rpartition('@')[2].partition('?')[0])
    raise InputError(f"camera URL '{shown}' is wrong: {fault}")


SOURCE = SourceKind(
    name='snapshot',
    address='URL of a snapshot, http://HOST/PATH',
    open=SnapshotSource,
    check=check_url,
    options=(
        SourceOption('timeout_s', 10.0, 'longest wait for the whole picture [s]', 0.1, 600.0),
    ),
)
