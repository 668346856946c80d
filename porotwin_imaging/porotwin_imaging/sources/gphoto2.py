"""A tethered camera (DSLR or mirrorless) through the program gphoto2: one photograph per poll.

To release the camera by another program, or by `gphoto2 --capture-tethered`, let it write into a
folder and use the source `folder`.
"""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import Remark
from porotwin_core.clock.stamps import steady_time
from porotwin_imaging.photograph.file_names import one_line, printable
from porotwin_imaging.photograph.photo_file import is_photograph
from porotwin_imaging.sources.camera_source import (
    CameraPhoto,
    Polled,
    SourceKind,
    SourceOption,
)

PROGRAM = 'gphoto2'
ANY_CAMERA = 'auto'
_PORT = re.compile(r'[a-z]+:[^\s]*')
_SETTING = re.compile(r'[\w/-]+=[^=]+')


class TetheredSource:
    """Releases the camera at each poll and takes the photograph over.

    Args:
        port: port of the camera as `gphoto2 --auto-detect` shows it, or 'auto' for the only one.
        config: settings such as 'iso=100,shutterspeed=1/60', made when the camera is found.
        timeout_s: longest time for a photograph [s]; then the program is ended.
        clock: returns the time of the release [s].

    Raises:
        InputError: port or settings are no such.
    """

    def __init__(
        self,
        port: str = ANY_CAMERA,
        *,
        config: str = '',
        timeout_s: float = 25.0,
        clock: Callable[[], float] = steady_time,
    ) -> None:
        check_port(port)
        self._options = [] if port == ANY_CAMERA else ['--port', port]
        self._config = _settings(config)
        self._configured = False
        self._timeout_s = timeout_s
        self._clock = clock

    def poll(self) -> Polled:
        """Take a photograph; see `CameraSource.poll`."""
        remarks: tuple[str, ...] = ()
        if not self._configured and self._config:
            settings = [part for one in self._config for part in ('--set-config', one)]
            _, fault = self._run(settings)
            if fault:
                return Polled([], [], absent=fault)
            remarks = (f'camera set to {", ".join(self._config)}',)
        self._configured = True
        with tempfile.TemporaryDirectory(prefix='porotwin-') as folder:
            target = ['--force-overwrite', '--filename', f'{folder}/%f.%C']
            moment, fault = self._run(['--capture-image-and-download', *target])
            found = sorted(Path(folder).iterdir())
            photos = [(path.name, path.read_bytes()) for path in found if path.is_file()]
        if not photos:
            self._configured = False  # a camera that was switched off forgets its settings
            return Polled([], [], fault or 'gphoto2 took no photograph; check the camera', remarks)
        for name, data in photos:
            if is_photograph(data):
                return Polled([CameraPhoto(data, moment, name)], [], remarks=remarks)
        name = photos[0][0]
        words = 'the photograph is no JPEG; set the camera to JPEG, or raw + JPEG'
        return Polled([], [Remark.of(name, 'other_format', words)], remarks=remarks)

    def _run(self, arguments: list[str]) -> tuple[float, str]:
        """Run gphoto2; return the moment of its start [s] and its fault in one line, if any."""
        moment = self._clock()
        try:
            process = subprocess.Popen(
                [PROGRAM, *self._options, *arguments],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                start_new_session=True, env={**os.environ, 'LC_ALL': 'C'},
            )  # fmt: skip
        except OSError as error:
            return moment, f'gphoto2 cannot be started: {error.strerror}'
        try:
            _, said = process.communicate(timeout=self._timeout_s)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            with contextlib.suppress(subprocess.TimeoutExpired):  # a child may live on
                process.communicate(timeout=1.0)
            return moment, f'gphoto2 is not done after {self._timeout_s:g} s; check the camera'
        if process.returncode:
            return moment, f'gphoto2 failed: {_reason(said) or process.returncode}'
        return moment, ''


def _reason(said: bytes) -> str:
    """Return the line of gphoto2's errors that says most."""
    lines = [line.strip(' *') for line in said.decode('utf-8', 'replace').splitlines()]
    lines = [line for line in lines if line]
    return one_line(next((line for line in lines if 'rror' in line), lines[0] if lines else ''))


def _settings(config: str) -> list[str]:
    """Return the settings in `config`.

    Raises:
        InputError: one is not KEY=VALUE.
    """
    settings = [part.strip() for part in config.split(',') if part.strip()]
    for setting in settings:
        if not _SETTING.fullmatch(setting):
            raise InputError(f"config '{printable(setting)}' is not KEY=VALUE, such as iso=100")
    return settings


def check_port(port: str) -> None:
    """Check that gphoto2 is installed and `port` may be one of its ports.

    Raises:
        InputError: it is not.
    """
    if port != ANY_CAMERA and not _PORT.fullmatch(port):
        raise InputError(
            f"gphoto2 port '{printable(port)}' is no port; write gphoto2:auto, or one that "
            "'gphoto2 --auto-detect' shows, such as gphoto2:usb:001,004"
        )
    if shutil.which(PROGRAM) is None:
        raise InputError('the program gphoto2 is not installed; install its package, gphoto2')


SOURCE = SourceKind(
    name='gphoto2',
    address="'auto', or a port such as usb:001,004",
    open=TetheredSource,
    check=check_port,
    options=(
        SourceOption('config', '', 'settings of the camera, such as iso=100,shutterspeed=1/60'),
        SourceOption('timeout_s', 25.0, 'longest time for a photograph [s]', 1.0, 600.0),
    ),
)
