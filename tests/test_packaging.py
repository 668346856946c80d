"""The wheel of the checkout: its contents, and that it imports without ROS."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent.name for path in ROOT.glob('porotwin_*/setup.py'))

WITHOUT_ROS = """
import sys
import importlib.abc

class Refuse(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {'rclpy', 'porotwin_msgs', 'std_msgs', 'sensor_msgs'}:
            raise ImportError(f'{name} is blocked in this test')

sys.meta_path.insert(0, Refuse())
sys.path.insert(0, sys.argv[1])
import porotwin_core.rig, porotwin_core.grid, porotwin_core.wells
import porotwin_solver.simulation
import porotwin_costa.training, porotwin_imaging.total_variation
import porotwin_recording.recording
import porotwin_diagnosis.examine
print(porotwin_solver.simulation.__file__)
"""


@pytest.fixture(scope='module')
def wheel(tmp_path_factory) -> Path:
    """The wheel that pip builds from a copy of the sources."""
    folder = tmp_path_factory.mktemp('wheel')
    listed = subprocess.run(
        ['git', 'ls-files', '--cached', '--others', '--exclude-standard'],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.split('\n')  # fmt: skip
    for name in filter(None, listed):
        source, copy = ROOT / name, folder / 'source' / name
        if source.is_file() and not name.startswith(('docs/', 'bags/')):
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(source.read_bytes())
    command = [*(sys.executable, '-m', 'pip', 'wheel', '-q', '--no-deps', '--no-build-isolation')]
    subprocess.run([*command, '-w', str(folder), str(folder / 'source')], check=True)
    return next(folder.glob('porotwin-*.whl'))


def test_the_wheel_holds_every_package_with_its_types(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for package in PACKAGES:
        assert f'{package}/py.typed' in names
        modules = (ROOT / package / package).rglob('*.py')
        assert {str(path.relative_to(ROOT / package)) for path in modules} <= names


def test_the_wheel_holds_the_web_page_and_the_sample_rig(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    package = ROOT / 'porotwin_page'
    scripts = [*package.rglob('web/*.js'), *package.rglob('panels/*.js')]
    expected = {str(path.relative_to(package)) for path in scripts if 'test' not in path.parts}
    assert {'porotwin_page/web/page.html', *expected} <= set(names)
    assert any(name.endswith('share/porotwin_hub/config/small_rig.yaml') for name in names)


def test_the_algorithms_import_without_ros(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    ran = subprocess.run(
        [sys.executable, '-c', WITHOUT_ROS, str(tmp_path)],
        check=False, capture_output=True, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip().startswith(str(tmp_path))
