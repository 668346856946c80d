"""The wheel of the checkout: its contents, and that all its algorithms import without ROS."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from test_without_ros import ALGORITHMS, dotted, imported_without_ros

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent.name for path in ROOT.glob('porotwin_*/setup.py'))


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
    assert not {name for name in names if name.startswith('lab/')}


def test_the_wheel_holds_the_web_page_and_the_sample_rig(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    package = ROOT / 'porotwin_page'
    scripts = [*package.rglob('web/*.js'), *package.rglob('panels/*.js')]
    expected = {str(path.relative_to(package)) for path in scripts if 'test' not in path.parts}
    expected |= {'porotwin_page/web/page.html', 'porotwin_diagnosis/report/page.html'}
    words = (ROOT / 'porotwin_diagnosis').rglob('porotwin_diagnosis/**/*.j2')
    expected |= {str(path.relative_to(ROOT / 'porotwin_diagnosis')) for path in words}
    assert expected <= set(names)
    assert any(name.endswith('share/porotwin_hub/config/small_rig.yaml') for name in names)


def test_the_algorithms_import_without_ros(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    failures, places = imported_without_ros(ALGORITHMS, path=tmp_path)
    assert failures == {}
    assert set(places) == {dotted(module) for module in ALGORITHMS}
    elsewhere = {name for name, place in places.items() if not place.startswith(str(tmp_path))}
    assert not elsewhere, f'{sorted(elsewhere)} are not from the wheel'


@pytest.mark.parametrize(
    'setup', sorted(ROOT.glob('porotwin_*/setup.py')), ids=lambda path: path.parent.name
)
def test_colcon_test_runs_pytest(setup: Path) -> None:
    # colcon-core takes pytest where the test dependencies name it, and unittest elsewhere
    assert "extras_require={'test': ['pytest']}" in setup.read_text(encoding='utf-8')
