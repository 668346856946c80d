"""Make an environment of the oldest libraries that we support, and test in it.

`python setup/oldest.py` takes the lower bounds in setup/requirements, without ROS, installs exactly
these into .venv-oldest, imports every module and runs quick tests. CI does the same on each push.
tests/test_oldest_versions.py imports the modules again once the environment is there.
"""

import subprocess
import sys
import venv

from install import PACKAGES, REQUIREMENTS, ROOT, fingerprint

OLDEST = ROOT / '.venv-oldest'
PYTHON = OLDEST / 'bin' / 'python'
INPUTS = ('setup/requirements/*.txt',)

BESIDE_TESTS = ('pytest', 'pytest-timeout', 'pytest-xdist', 'hypothesis')
"""Tools of the quick tests, of any version."""

OF_LIBRARIES = (
    'porotwin_pumps/test/test_other_protocols.py',
    'porotwin_recording/test/test_dataset_variables.py',
    'porotwin_recording/test/test_vtk_export.py',
)
"""Tests beside those of core and solver: of pymodbus, xarray and pyevtk."""

# an old library warns of the new ones that it meets
QUIET = ('-W', 'ignore::DeprecationWarning', '-W', 'ignore::RuntimeWarning')


def bounds() -> list[str]:
    """Return the oldest allowed version of every requirement of the product, as NAME==VERSION."""
    lines = [
        line
        for path in sorted(REQUIREMENTS.glob('*.txt'))
        if path.stem not in ('ros', 'test')
        for line in path.read_text(encoding='utf-8').splitlines()
        if line and not line.startswith('#')
    ]
    return [line.replace('>=', '==') for line in lines]


def make() -> None:
    """Install the oldest libraries, if the environment has others."""
    stamp = OLDEST / 'porotwin'
    if stamp.is_file() and stamp.read_text() == fingerprint(INPUTS):
        return
    venv.EnvBuilder(with_pip=True, clear=True).create(OLDEST)
    subprocess.run([PYTHON, '-m', 'pip', 'install', '-q', *bounds(), *BESIDE_TESTS], check=True)
    site = next((OLDEST / 'lib').glob('python3*/site-packages'))
    folders = (*(ROOT / name for name in PACKAGES), ROOT)
    (site / 'porotwin.pth').write_text(''.join(f'{folder}\n' for folder in folders))
    stamp.write_text(fingerprint(INPUTS))


def main() -> int:
    """Return the exit status of the tests."""
    make()
    quick = ('-q', '-n', '2', '-m', 'not graph and not slow', '-p', 'no:cacheprovider')
    tests = ('tests/test_without_ros.py', 'porotwin_core', 'porotwin_solver', *OF_LIBRARIES)
    return subprocess.run(
        [PYTHON, '-m', 'pytest', *QUIET, *quick, *tests], cwd=ROOT, check=False
    ).returncode


if __name__ == '__main__':
    sys.exit(main())
